-- secrets: 1WYEY_AYVz05YzugQ1KxYeY7IaiLhSDE ZvhnEclKO7KWjNMs5XQ0vA32qFuwLwxt 6B-bHyu_dZuKArQIU6wUR8dLBlhoMRuV
PRAGMA user_version=1;
BEGIN TRANSACTION;
CREATE TABLE links (
  id TEXT PRIMARY KEY, terrain TEXT NOT NULL, role TEXT NOT NULL, name TEXT NOT NULL, hash BLOB NOT NULL,
  created REAL NOT NULL, revoked REAL) WITHOUT ROWID;
INSERT INTO "links" VALUES('HyKg0gRRcApa','t','view','view',X'FD4B819356DC2F95F888BDA6735867E97A3B8099C9FA8D1054EA629B90758F75',1.79544808741684317593e+09,NULL);
INSERT INTO "links" VALUES('SNuZCNW7r5Q4','t','owner','owner',X'855EF78E2C1F697BD293FA61265280FC969AF72DA4E65D9EE122CF98B8BC7E96',1.79544808741506052018e+09,NULL);
INSERT INTO "links" VALUES('iFEkr6cBF9uO','t','edit','edit',X'EA07D32D427FD1B0535B0EA10D5F263540A20734FC3BDC71CC6CBF63AB63914C',1.79544808741627025605e+09,NULL);
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
CREATE TABLE snapshots (
  terrain TEXT NOT NULL, clock INTEGER NOT NULL, document TEXT NOT NULL, PRIMARY KEY (terrain, clock)) WITHOUT ROWID;
INSERT INTO "snapshots" VALUES('t',0,'{"id":"t","clock":0,"settings":{"size_m":4096.0,"title":"Untitled terrain","reach_m":128.0,"border":"free","sea_level_m":null,"seed":1,"look":"natural","detail":1.0,"rule":"landscape","sun_azimuth_deg":115.0,"sun_elevation_deg":24.0,"place":null},"strokes":[],"deleted":[],"layers":[],"deleted_layers":[]}');
CREATE TABLE terrains (id TEXT PRIMARY KEY, created REAL NOT NULL) WITHOUT ROWID;
INSERT INTO "terrains" VALUES('t',1.79544808741241526607e+09);
CREATE UNIQUE INDEX ops_by_id ON ops (terrain, client, counter);
CREATE INDEX links_by_terrain ON links (terrain, created);
CREATE UNIQUE INDEX links_by_hash ON links (hash);
COMMIT;
