-- secrets: dNKFJT4bUGmE5WavJVoGvx6viIqAd-K3 fQn7IZWFdpsgJjuSJvybnovKXXmRvpEr KJCXYkMVNuJE8uf1IpklxOiwQhJw_nWY
PRAGMA user_version=9;
BEGIN TRANSACTION;
CREATE TABLE classes (
  id TEXT PRIMARY KEY, terrain TEXT NOT NULL, title TEXT NOT NULL, created REAL NOT NULL, clock INTEGER NOT NULL,
  document TEXT NOT NULL, together INTEGER NOT NULL, places INTEGER NOT NULL, code TEXT, code_until REAL, ended REAL);
INSERT INTO "classes" VALUES('k','t','A class',1.79607163968060874943e+09,1,'{"id":"t","clock":1,"settings":{"size_m":4096.0,"edition":1,"title":"Untitled terrain","reach_m":128.0,"border":"free","sea_level_m":null,"lakes_m":null,"rivers":0.0,"wetness":1.0,"seed":1,"look":"natural","detail":1.0,"rule":"landscape","erosion":0.0,"erosion_scale":10.0,"hold":1.0,"sun_azimuth_deg":115.0,"sun_elevation_deg":24.0,"place":null,"task":null,"task_pictures":[]},"strokes":[{"id":"s0","author":"","kind":"profile","first":[1000.0,1000.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"yields":0.0,"paint":null,"course":null,"locked":false,"hidden":false,"label":"","finished":false}],"deleted":[],"layers":[],"deleted_layers":[]}',1,30,NULL,0.0,NULL);
CREATE TABLE copies (
  class TEXT NOT NULL, number INTEGER NOT NULL, terrain TEXT NOT NULL UNIQUE, frozen INTEGER NOT NULL,
  PRIMARY KEY (class, number)) WITHOUT ROWID;
CREATE TABLE folded_ids (
  terrain TEXT NOT NULL, client TEXT NOT NULL, counter INTEGER NOT NULL, upto INTEGER NOT NULL, clock INTEGER NOT NULL,
  PRIMARY KEY (terrain, client, counter)) WITHOUT ROWID;
CREATE TABLE folds (
  terrain TEXT NOT NULL, last INTEGER NOT NULL, first INTEGER NOT NULL, kept INTEGER NOT NULL,
  PRIMARY KEY (terrain, last)) WITHOUT ROWID;
CREATE TABLE grids (
  terrain TEXT NOT NULL, digest TEXT NOT NULL, PRIMARY KEY (terrain, digest)) WITHOUT ROWID;
CREATE TABLE lessons (terrain TEXT PRIMARY KEY, state TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE links (
  id TEXT PRIMARY KEY, terrain TEXT NOT NULL, role TEXT NOT NULL, name TEXT NOT NULL, hash BLOB NOT NULL,
  created REAL NOT NULL, revoked REAL, parent TEXT) WITHOUT ROWID;
INSERT INTO "links" VALUES('2YQYrss-v2QY','t','owner','owner',X'58D5CE989EA595286A80B9F91D29F1680B3258089BC1658B1473706C7E9CD117',1.79607163967108392722e+09,NULL,NULL);
INSERT INTO "links" VALUES('6CZ_r3edZxGg','t','edit','edit',X'52907422843C303C734B73FA1798FCCAD504D5BFA94642DCF4D41C220832BDBF',1.79607163967252230645e+09,NULL,NULL);
INSERT INTO "links" VALUES('CUIYs8RGUyfo','t','view','view',X'495B2AD4293D5B0BD4F453DD2B525C04A8920BE96C7D8875DC18C76544A84AC2',1.79607163967650222775e+09,NULL,NULL);
CREATE TABLE makers (
  terrain TEXT NOT NULL, thing TEXT NOT NULL, client TEXT NOT NULL, PRIMARY KEY (terrain, thing)) WITHOUT ROWID;
INSERT INTO "makers" VALUES('t','s0','c');
INSERT INTO "makers" VALUES('t','s1','c');
INSERT INTO "makers" VALUES('t','s2','c');
INSERT INTO "makers" VALUES('t','s3','c');
INSERT INTO "makers" VALUES('t','s4','c');
CREATE TABLE moments (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, at REAL NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "moments" VALUES('t',1,1.79607163966913652422e+09);
CREATE TABLE ops (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, client TEXT NOT NULL, counter INTEGER NOT NULL,
  author TEXT NOT NULL, op TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "ops" VALUES('t',1,'c',1,'c','{"type":"stroke.begin","stroke":{"id":"s0","author":"","kind":"profile","first":[1000.0,1000.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"yields":0.0,"paint":null,"course":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',2,'c',2,'c','{"type":"stroke.begin","stroke":{"id":"s1","author":"","kind":"profile","first":[1000.0,1001.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"yields":0.0,"paint":null,"course":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',3,'c',3,'c','{"type":"stroke.begin","stroke":{"id":"s2","author":"","kind":"profile","first":[1000.0,1002.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"yields":0.0,"paint":null,"course":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',4,'c',4,'c','{"type":"stroke.begin","stroke":{"id":"s3","author":"","kind":"profile","first":[1000.0,1003.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"yields":0.0,"paint":null,"course":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',5,'c',5,'c','{"type":"stroke.begin","stroke":{"id":"s4","author":"","kind":"profile","first":[1000.0,1004.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"yields":0.0,"paint":null,"course":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',6,'c',6,'c','{"type":"terrain.set","fields":{"title":"An old one"}}');
INSERT INTO "ops" VALUES('t',7,'c',7,'c','{"type":"stroke.delete","stroke":"s3"}');
CREATE TABLE people (
  terrain TEXT NOT NULL, client TEXT NOT NULL, name TEXT NOT NULL, colour TEXT NOT NULL, person TEXT, conducts INTEGER,
  PRIMARY KEY (terrain, client)) WITHOUT ROWID;
CREATE TABLE previews (
  terrain TEXT PRIMARY KEY, token TEXT NOT NULL UNIQUE, shown INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE pupils (
  link TEXT PRIMARY KEY, class TEXT NOT NULL, number INTEGER NOT NULL, name TEXT NOT NULL, joined REAL NOT NULL)
  WITHOUT ROWID;
CREATE TABLE server (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
INSERT INTO "server" VALUES('swept_from','1798663639.5693285');
CREATE TABLE snapshots (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, document TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "snapshots" VALUES('t',0,'{"id":"t","clock":0,"settings":{"size_m":4096.0,"edition":1,"title":"Untitled terrain","reach_m":128.0,"border":"free","sea_level_m":null,"lakes_m":null,"rivers":0.0,"wetness":1.0,"seed":1,"look":"natural","detail":1.0,"rule":"landscape","erosion":0.0,"erosion_scale":10.0,"hold":1.0,"sun_azimuth_deg":115.0,"sun_elevation_deg":24.0,"place":null,"task":null,"task_pictures":[]},"strokes":[],"deleted":[],"layers":[],"deleted_layers":[]}');
CREATE TABLE terrains (id TEXT PRIMARY KEY, created REAL NOT NULL, deleted REAL) WITHOUT ROWID;
INSERT INTO "terrains" VALUES('t',1.79607163966507768632e+09,NULL);
CREATE UNIQUE INDEX ops_by_id ON ops (terrain, client, counter);
CREATE INDEX links_by_terrain ON links (terrain, created);
CREATE UNIQUE INDEX links_by_hash ON links (hash);
CREATE INDEX links_by_parent ON links (parent) WHERE parent IS NOT NULL;
CREATE INDEX terrains_deleted ON terrains (deleted) WHERE deleted IS NOT NULL;
CREATE TRIGGER ops_used_once BEFORE INSERT ON ops WHEN
  NEW.clock <= (SELECT last FROM folds WHERE terrain=NEW.terrain ORDER BY last DESC LIMIT 1)
  OR NEW.counter <= (SELECT upto FROM folded_ids WHERE terrain=NEW.terrain AND client=NEW.client
    AND counter<=NEW.counter ORDER BY counter DESC LIMIT 1)
BEGIN SELECT RAISE(ABORT, 'a folded clock or id is used again'); END;
CREATE INDEX classes_by_terrain ON classes (terrain);
CREATE UNIQUE INDEX classes_by_code ON classes (code) WHERE code IS NOT NULL;
CREATE INDEX pupils_by_class ON pupils (class, number);
COMMIT;
