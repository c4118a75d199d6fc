-- secrets: yrWELRvRW7qddZDN0HUyOLB_xSDoL-_2 9PE36deeMKhiUuD_0yxlEmAT3z7wq9K0 XtKEiMkBmgN5wapQl87569TOMMMF3f0y
PRAGMA user_version=5;
BEGIN TRANSACTION;
CREATE TABLE grids (
  terrain TEXT NOT NULL, digest TEXT NOT NULL, PRIMARY KEY (terrain, digest)) WITHOUT ROWID;
CREATE TABLE links (
  id TEXT PRIMARY KEY, terrain TEXT NOT NULL, role TEXT NOT NULL, name TEXT NOT NULL, hash BLOB NOT NULL,
  created REAL NOT NULL, revoked REAL, parent TEXT) WITHOUT ROWID;
INSERT INTO "links" VALUES('hTGIEGW_gfX-','t','edit','edit',X'82A16BE6EE40BE12ADB02C17EEA8411C5ABAC7930DF9B2613DFE44F3A4115DE2',1.79547005218731641762e+09,NULL,NULL);
INSERT INTO "links" VALUES('mqoDcz2XDM_O','t','owner','owner',X'D67C85623A8D9ED6C36C396F0D774D8CB4D171831EAB4D708525E42588ABF7DE',1.79547005218698644633e+09,NULL,NULL);
INSERT INTO "links" VALUES('u9Yr46czhWAL','t','view','view',X'E11025C76F090748580FA6E2E7B4D409FE53ED814D179E73105880292A0FF647',1.79547005219019412992e+09,NULL,NULL);
CREATE TABLE moments (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, at REAL NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "moments" VALUES('t',1,1.79547005218664336208e+09);
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
INSERT INTO "server" VALUES('swept_from','1798062052.0843136');
CREATE TABLE snapshots (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, document TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "snapshots" VALUES('t',0,'{"id":"t","clock":0,"settings":{"size_m":4096.0,"edition":1,"title":"Untitled terrain","reach_m":128.0,"border":"free","sea_level_m":null,"lakes_m":null,"seed":1,"look":"natural","detail":1.0,"rule":"landscape","sun_azimuth_deg":115.0,"sun_elevation_deg":24.0,"place":null},"strokes":[],"deleted":[],"layers":[],"deleted_layers":[]}');
CREATE TABLE terrains (id TEXT PRIMARY KEY, created REAL NOT NULL, deleted REAL) WITHOUT ROWID;
INSERT INTO "terrains" VALUES('t',1.79547005218258571624e+09,NULL);
CREATE UNIQUE INDEX ops_by_id ON ops (terrain, client, counter);
CREATE INDEX links_by_terrain ON links (terrain, created);
CREATE UNIQUE INDEX links_by_hash ON links (hash);
CREATE INDEX links_by_parent ON links (parent) WHERE parent IS NOT NULL;
CREATE INDEX terrains_deleted ON terrains (deleted) WHERE deleted IS NOT NULL;
COMMIT;
