-- secrets: -FOT97Sux7Hulj4ppgSKjby34iJVxnRd TqagFjMWyxEeWmmCbKJsZGpxTsxCZmS2 baa87LetI7J5u4AqBcZU4lT1aBPnfHid
PRAGMA user_version=2;
BEGIN TRANSACTION;
CREATE TABLE grids (
  terrain TEXT NOT NULL, digest TEXT NOT NULL, PRIMARY KEY (terrain, digest)) WITHOUT ROWID;
CREATE TABLE links (
  id TEXT PRIMARY KEY, terrain TEXT NOT NULL, role TEXT NOT NULL, name TEXT NOT NULL, hash BLOB NOT NULL,
  created REAL NOT NULL, revoked REAL) WITHOUT ROWID;
INSERT INTO "links" VALUES('eXE0oxcgSqZ8','t','edit','edit',X'359D9E6B58883AA846393FA12B80AF47FD6940980B40B114D4661E51F6850652',1.79544808845252180104e+09,NULL);
INSERT INTO "links" VALUES('vMJ9Hq-X30We','t','view','view',X'C14DBF9361D5289ACD17CB133CB37EA986E5B2B3643A049142139F2CA7BA5AD2',1.795448088452824831e+09,NULL);
INSERT INTO "links" VALUES('yGblf6iHt1fg','t','owner','owner',X'A0CC0137A68158B4F8F61C2BFFBDB847C38C4818B592EFF7EE1929529A3057F1',1.79544808845209193232e+09,NULL);
CREATE TABLE moments (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, at REAL NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "moments" VALUES('t',1,1.795448088451808691e+09);
CREATE TABLE ops (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, client TEXT NOT NULL, counter INTEGER NOT NULL,
  author TEXT NOT NULL, op TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "ops" VALUES('t',1,'c',1,'c','{"type":"stroke.begin","stroke":{"id":"s0","author":"","kind":"profile","first":[1000.0,1000.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"paint":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',2,'c',2,'c','{"type":"stroke.begin","stroke":{"id":"s1","author":"","kind":"profile","first":[1000.0,1001.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"paint":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',3,'c',3,'c','{"type":"stroke.begin","stroke":{"id":"s2","author":"","kind":"profile","first":[1000.0,1002.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"paint":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',4,'c',4,'c','{"type":"stroke.begin","stroke":{"id":"s3","author":"","kind":"profile","first":[1000.0,1003.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"paint":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',5,'c',5,'c','{"type":"stroke.begin","stroke":{"id":"s4","author":"","kind":"profile","first":[1000.0,1004.0,0.0],"last":[3000.0,1000.0,5.0],"curve":[[0.0,0.0],[9.0,50.0]],"left":null,"right":null,"plateau_radius_m":0.0,"amplitude_m":0.0,"roughness":0.5,"paint":null,"locked":false,"hidden":false,"label":"","finished":false}}');
INSERT INTO "ops" VALUES('t',6,'c',6,'c','{"type":"terrain.set","fields":{"title":"An old one"}}');
INSERT INTO "ops" VALUES('t',7,'c',7,'c','{"type":"stroke.delete","stroke":"s3"}');
CREATE TABLE people (
  terrain TEXT NOT NULL, client TEXT NOT NULL, name TEXT NOT NULL, colour TEXT NOT NULL,
  PRIMARY KEY (terrain, client)) WITHOUT ROWID;
CREATE TABLE snapshots (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, document TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "snapshots" VALUES('t',0,'{"id":"t","clock":0,"settings":{"size_m":4096.0,"title":"Untitled terrain","reach_m":128.0,"border":"free","sea_level_m":null,"lakes_m":null,"seed":1,"look":"natural","detail":1.0,"rule":"landscape","sun_azimuth_deg":115.0,"sun_elevation_deg":24.0,"place":null},"strokes":[],"deleted":[],"layers":[],"deleted_layers":[]}');
CREATE TABLE terrains (id TEXT PRIMARY KEY, created REAL NOT NULL) WITHOUT ROWID;
INSERT INTO "terrains" VALUES('t',1.79544808845083189016e+09);
CREATE UNIQUE INDEX ops_by_id ON ops (terrain, client, counter);
CREATE INDEX links_by_terrain ON links (terrain, created);
CREATE UNIQUE INDEX links_by_hash ON links (hash);
COMMIT;
