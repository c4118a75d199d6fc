-- secrets: 9mNZUkWxg3uv4nGcOYJiCIh_ciAOSRqq i0d-q-14lBE-g7kdWwve_e0Ju5bz95zQ GmSA6Y8ZG1nUDPDiBWfLauteDUwn7CHf
PRAGMA user_version=7;
BEGIN TRANSACTION;
CREATE TABLE classes (
  id TEXT PRIMARY KEY, terrain TEXT NOT NULL, title TEXT NOT NULL, created REAL NOT NULL, clock INTEGER NOT NULL,
  document TEXT NOT NULL, together INTEGER NOT NULL, places INTEGER NOT NULL, code TEXT, code_until REAL, ended REAL);
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
INSERT INTO "links" VALUES('XIxB5VVAuGmR','t','edit','edit',X'85DCAC6BE614BBC7864E896F914D7158681B54659753E99D4A341AF7A3EA9197',1.79565946534024047844e+09,NULL,NULL);
INSERT INTO "links" VALUES('v88cHHf4pyuM','t','owner','owner',X'DA11382728BAB0EBC3693AD6074DF3D0C3A72195ED71CD095E82A5C98A1273DB',1.79565946532936978339e+09,NULL,NULL);
INSERT INTO "links" VALUES('xCLNEOudLmVN','t','view','view',X'5E4EBE0CCC9D6569DBB31F461350E1F633DDF64356EE957BE58022A2F6D78381',1.79565946534977507586e+09,NULL,NULL);
CREATE TABLE makers (
  terrain TEXT NOT NULL, thing TEXT NOT NULL, client TEXT NOT NULL, PRIMARY KEY (terrain, thing)) WITHOUT ROWID;
INSERT INTO "makers" VALUES('t','s0','c');
INSERT INTO "makers" VALUES('t','s1','c');
INSERT INTO "makers" VALUES('t','s2','c');
INSERT INTO "makers" VALUES('t','s3','c');
INSERT INTO "makers" VALUES('t','s4','c');
CREATE TABLE moments (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, at REAL NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "moments" VALUES('t',1,1.79565946532239460948e+09);
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
INSERT INTO "server" VALUES('swept_from','1798251465.272558');
CREATE TABLE snapshots (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, document TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "snapshots" VALUES('t',0,'{"id":"t","clock":0,"settings":{"size_m":4096.0,"edition":1,"title":"Untitled terrain","reach_m":128.0,"border":"free","sea_level_m":null,"lakes_m":null,"rivers":0.0,"wetness":1.0,"seed":1,"look":"natural","detail":1.0,"rule":"landscape","erosion":0.0,"erosion_scale":10.0,"hold":1.0,"sun_azimuth_deg":115.0,"sun_elevation_deg":24.0,"place":null},"strokes":[],"deleted":[],"layers":[],"deleted_layers":[]}');
CREATE TABLE terrains (id TEXT PRIMARY KEY, created REAL NOT NULL, deleted REAL) WITHOUT ROWID;
INSERT INTO "terrains" VALUES('t',1.79565946531640100477e+09,NULL);
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
