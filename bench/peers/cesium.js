// CesiumJS: the same heights through its custom terrain provider, its own tiles, error metric and culling; unlit, no
// sky, no fog, no antialiasing. The domain lies at longitude and latitude 0, where a degree is 111,319.49 m both ways.

const METRES_PER_DEGREE = 111319.49;
const SAMPLES = 65;
/** Frames without anything to load after which nothing more will come. */
const SETTLED = 30;

function loadCesium() {
  globalThis.CESIUM_BASE_URL = "./node_modules/cesium/Build/Cesium/";
  return new Promise((done, fail) => {
    const script = document.createElement("script");
    script.src = `${globalThis.CESIUM_BASE_URL}Cesium.js`;
    script.onload = () => done(globalThis.Cesium);
    script.onerror = () => fail(new Error("CesiumJS did not load"));
    document.head.append(script);
  });
}

function provider(C, { heights, side, sizeM }) {
  const perDegree = (METRES_PER_DEGREE / sizeM) * (side - 1);
  const at = (u, v) => {
    if (u < 0 || v < 0 || u > side - 1 || v > side - 1) return 0;
    const i = Math.min(side - 2, Math.floor(u));
    const j = Math.min(side - 2, Math.floor(v));
    const f = u - i;
    const g = v - j;
    const k = j * side + i;
    const south = heights[k] * (1 - f) + heights[k + 1] * f;
    const north = heights[k + side] * (1 - f) + heights[k + side + 1] * f;
    return south * (1 - g) + north * g;
  };
  const made = new C.CustomHeightmapTerrainProvider({
    width: SAMPLES,
    height: SAMPLES,
    callback: (x, y, level) => {
      const r = made.tilingScheme.tileXYToRectangle(x, y, level);
      const out = new Float32Array(SAMPLES * SAMPLES);
      for (let j = 0; j < SAMPLES; j += 1) {
        const latitude = C.Math.toDegrees(r.north - ((r.north - r.south) * j) / (SAMPLES - 1));
        for (let i = 0; i < SAMPLES; i += 1) {
          const longitude = C.Math.toDegrees(r.west + ((r.east - r.west) * i) / (SAMPLES - 1));
          out[j * SAMPLES + i] = at(longitude * perDegree, latitude * perDegree);
        }
      }
      return out;
    },
  });
  return made;
}

function widget(C, ground) {
  const { width, height, camera, sse } = ground;
  const box = document.createElement("div");
  Object.assign(box.style, { position: "absolute", inset: "0", width: `${width}px`, height: `${height}px` });
  document.body.append(box);
  const made = new C.CesiumWidget(box, {
    terrainProvider: provider(C, ground),
    baseLayer: false,
    skyBox: false,
    skyAtmosphere: false,
    useDefaultRenderLoop: false,
    contextOptions: { webgl: { antialias: false } },
    msaaSamples: 1,
  });
  const { scene } = made;
  scene.postProcessStages.fxaa.enabled = false;
  scene.fog.enabled = false;
  Object.assign(scene.globe, {
    baseColor: new C.Color(0.55, 0.5, 0.42, 1),
    maximumScreenSpaceError: sse,
    showGroundAtmosphere: false,
    enableLighting: false,
    tileCacheSize: 4000,
  });
  // Cesium's field of view is that of the longer side.
  scene.camera.frustum.fov = 2 * Math.atan((Math.tan((camera.fovDeg * Math.PI) / 360) * width) / height);
  made.resize();
  return made;
}

/** Vertical error on the screen, pixels: the shown ground against the heights, at the grid's samples `places`. */
function screenError(C, scene, { heights, side, sizeM, camera, height, places }) {
  const errors = [];
  const perRadian = height / 2 / Math.tan((camera.fovDeg * Math.PI) / 360);
  const cell = sizeM / (side - 1);
  for (const k of places) {
    const [x, y] = [(k % side) * cell, Math.floor(k / side) * cell];
    const shown = scene.globe.getHeight(C.Cartographic.fromDegrees(x / METRES_PER_DEGREE, y / METRES_PER_DEGREE));
    if (shown === undefined) continue;
    const truth = heights[k];
    const away = Math.hypot(x - camera.eye[0], y - camera.eye[1], truth - camera.eye[2]);
    errors.push((Math.abs(shown - truth) * perRadian) / away);
  }
  errors.sort((a, b) => a - b);
  const quantile = (q) => errors[Math.floor(q * (errors.length - 1))];
  return { places: errors.length, p50: quantile(0.5), p95: quantile(0.95), max: quantile(1) };
}

export async function openCesium(ground) {
  const C = await loadCesium();
  const { scene } = widget(C, ground);
  const { camera } = ground;
  const at = ([x, y, z]) => C.Cartesian3.fromDegrees(x / METRES_PER_DEGREE, y / METRES_PER_DEGREE, z);
  const look = (step) => {
    const eye = at([camera.eye[0] + step * camera.stepM, camera.eye[1], camera.eye[2]]);
    const target = at([camera.target[0] + step * camera.stepM, camera.target[1], camera.target[2]]);
    const direction = C.Cartesian3.normalize(C.Cartesian3.subtract(target, eye, new C.Cartesian3()), new C.Cartesian3());
    scene.camera.setView({
      destination: eye,
      orientation: { direction, up: C.Cartesian3.normalize(eye, new C.Cartesian3()) },
    });
  };
  look(0);
  const began = performance.now();
  // Loaded for now is not loaded for good: what has come asks for more.
  let loaded = 0;
  while (loaded < SETTLED && performance.now() - began < 240_000) {
    scene.render();
    await new Promise((done) => setTimeout(done, 20));
    loaded = scene.globe.tilesLoaded ? loaded + 1 : 0;
  }
  let triangles = 0;
  let tiles = 0;
  for (const { data } of scene.globe._surface._tilesToRender) {
    const mesh = data.renderedMesh ?? data.mesh;
    if (mesh === undefined) continue;
    triangles += mesh.indices.length / 3;
    tiles += 1;
  }
  const gl = scene.context._gl;
  const pixel = new Uint8Array(4);
  return {
    facts: {
      version: C.VERSION,
      backend: "webgl2",
      screen_space_error: ground.sse,
      settled: loaded >= SETTLED,
      tiles,
      triangles,
      screen_error_px: screenError(C, scene, ground),
    },
    look,
    draw: () => scene.render(),
    sync: async () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel),
  };
}
