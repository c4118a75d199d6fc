-- secrets: ziYJtXT2nAj6Jbj2gJ_tuzw15ZNR1P1z zStpBWd1GK1pWYuFOvUbIWeqzN8CvJ6x slLUIoq3n7FRSdRlm4yIRCxM3pEIe4qs
PRAGMA user_version=6;
BEGIN TRANSACTION;
CREATE TABLE folded_ids (
  terrain TEXT NOT NULL, client TEXT NOT NULL, counter INTEGER NOT NULL, upto INTEGER NOT NULL, clock INTEGER NOT NULL,
  PRIMARY KEY (terrain, client, counter)) WITHOUT ROWID;
CREATE TABLE folds (
  terrain TEXT NOT NULL, last INTEGER NOT NULL, first INTEGER NOT NULL, kept INTEGER NOT NULL,
  PRIMARY KEY (terrain, last)) WITHOUT ROWID;
CREATE TABLE grids (
  terrain TEXT NOT NULL, digest TEXT NOT NULL, PRIMARY KEY (terrain, digest)) WITHOUT ROWID;
CREATE TABLE links (
  id TEXT PRIMARY KEY, terrain TEXT NOT NULL, role TEXT NOT NULL, name TEXT NOT NULL, hash BLOB NOT NULL,
  created REAL NOT NULL, revoked REAL, parent TEXT) WITHOUT ROWID;
INSERT INTO "links" VALUES('FiaInDzjd6Tx','t','view','view',X'16CE909CACDF633D0CBED7AD612167D1FA77D3BBEE64AB9831A06C2A6FEE58D7',1.79564632602354788777e+09,NULL,NULL);
INSERT INTO "links" VALUES('GTVndf_86T5V','t','edit','edit',X'24E1D5ADB12F967468FFA83E5B331E391EA6B599CAE0BD4B979DFA78043DA99A',1.79564632602023768422e+09,NULL,NULL);
INSERT INTO "links" VALUES('wfO1IZYqu4Cl','t','owner','owner',X'212219497439894C6DE68B80E1C1F2C28C89E3651E9F49A395ABAF14B0483C22',1.79564632601567745204e+09,NULL,NULL);
CREATE TABLE moments (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, at REAL NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "moments" VALUES('t',1,1.79564632601471924782e+09);
CREATE TABLE ops (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, client TEXT NOT NULL, counter INTEGER NOT NULL,
  author TEXT NOT NULL, op TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "ops" VALUES('t',1,'c',1,'c','{"type":"stroke.begin","stroke":{"id":"s0","author":"","kind":"profile","first":[1000.0,1000.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"yields":0.0,"paint":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',2,'c',2,'c','{"type":"stroke.begin","stroke":{"id":"s1","author":"","kind":"profile","first":[1000.0,1001.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"yields":0.0,"paint":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',3,'c',3,'c','{"type":"stroke.begin","stroke":{"id":"s2","author":"","kind":"profile","first":[1000.0,1002.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"yields":0.0,"paint":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',4,'c',4,'c','{"type":"stroke.begin","stroke":{"id":"s3","author":"","kind":"profile","first":[1000.0,1003.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"yields":0.0,"paint":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',5,'c',5,'c','{"type":"stroke.begin","stroke":{"id":"s4","author":"","kind":"profile","first":[1000.0,1004.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"yields":0.0,"paint":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',6,'c',6,'c','{"type":"terrain.set","fields":{"title":"An old one"}}');
INSERT INTO "ops" VALUES('t',7,'c',7,'c','{"type":"stroke.delete","stroke":"s3"}');
CREATE TABLE people (
  terrain TEXT NOT NULL, client TEXT NOT NULL, name TEXT NOT NULL, colour TEXT NOT NULL,
  PRIMARY KEY (terrain, client)) WITHOUT ROWID;
CREATE TABLE previews (
  terrain TEXT PRIMARY KEY, token TEXT NOT NULL UNIQUE, shown INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE server (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
INSERT INTO "server" VALUES('swept_from','1798238325.9952846');
CREATE TABLE snapshots (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, document TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "snapshots" VALUES('t',0,'{"id":"t","clock":0,"settings":{"size_m":4096.0,"edition":1,"title":"Untitled terrain","reach_m":128.0,"border":"free","sea_level_m":null,"lakes_m":null,"seed":1,"look":"natural","detail":1.0,"rule":"landscape","sun_azimuth_deg":115.0,"sun_elevation_deg":24.0,"place":null},"strokes":[],"deleted":[],"layers":[],"deleted_layers":[]}');
CREATE TABLE terrains (id TEXT PRIMARY KEY, created REAL NOT NULL, deleted REAL) WITHOUT ROWID;
INSERT INTO "terrains" VALUES('t',1.79564632601258730888e+09,NULL);
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
COMMIT;
