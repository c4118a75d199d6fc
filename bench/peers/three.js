// three.js: the whole grid as one mesh, its vertices placed beforehand or displaced by a texture in the vertex shader.

function grid(heights, side, sizeM) {
  const cell = sizeM / (side - 1);
  const positions = new Float32Array(3 * side * side);
  const normals = new Float32Array(3 * side * side);
  const at = (i, j) => heights[Math.min(side - 1, Math.max(0, j)) * side + Math.min(side - 1, Math.max(0, i))];
  for (let j = 0; j < side; j += 1) {
    for (let i = 0; i < side; i += 1) {
      const k = 3 * (j * side + i);
      const x = (at(i - 1, j) - at(i + 1, j)) / (2 * cell);
      const y = (at(i, j - 1) - at(i, j + 1)) / (2 * cell);
      const length = Math.hypot(x, y, 1);
      positions.set([i * cell, j * cell, at(i, j)], k);
      normals.set([x / length, y / length, 1 / length], k);
    }
  }
  const indices = new Uint32Array(6 * (side - 1) ** 2);
  let k = 0;
  for (let j = 0; j + 1 < side; j += 1) {
    for (let i = 0; i + 1 < side; i += 1) {
      const a = j * side + i;
      indices.set([a, a + 1, a + side, a + side, a + 1, a + side + 1], k);
      k += 6;
    }
  }
  return { positions, normals, indices };
}

function displaced(THREE, geometry, { heights, side }, positions) {
  const flat = positions.slice();
  const uv = new Float32Array(2 * side * side);
  for (let k = 0; k < side * side; k += 1) {
    flat[3 * k + 2] = 0;
    uv.set([((k % side) + 0.5) / side, (Math.floor(k / side) + 0.5) / side], 2 * k);
  }
  const up = new Float32Array(3 * side * side);
  for (let k = 0; k < side * side; k += 1) up[3 * k + 2] = 1;
  geometry.setAttribute("position", new THREE.BufferAttribute(flat, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(up, 3));
  geometry.setAttribute("uv", new THREE.BufferAttribute(uv, 2));
  const map = new THREE.DataTexture(heights, side, side, THREE.RedFormat, THREE.FloatType);
  map.minFilter = THREE.NearestFilter;
  map.magFilter = THREE.NearestFilter;
  map.needsUpdate = true;
  return { displacementMap: map, displacementScale: 1 };
}

async function renderer(THREE, webgpu, width, height) {
  const canvas = document.createElement("canvas");
  document.body.append(canvas);
  const made = webgpu
    ? new THREE.WebGPURenderer({ canvas, antialias: false })
    : new THREE.WebGLRenderer({ canvas, antialias: false });
  made.setPixelRatio(1);
  made.setSize(width, height);
  if (webgpu) await made.init();
  return made;
}

export async function openThree(ground, { webgpu, displace }) {
  const THREE = await import(webgpu ? "three/webgpu" : "three");
  const { heights, side, sizeM, camera, sun, width, height } = ground;
  const drawn = await renderer(THREE, webgpu, width, height);
  const { positions, normals, indices } = grid(heights, side, sizeM);
  const geometry = new THREE.BufferGeometry();
  geometry.setIndex(new THREE.BufferAttribute(indices, 1));
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
  const material = new THREE.MeshLambertMaterial({ color: 0x8c8069 });
  if (displace) Object.assign(material, displaced(THREE, geometry, ground, positions));
  const mesh = new THREE.Mesh(geometry, material);
  mesh.frustumCulled = false;
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0.6, 0.75, 0.9);
  const light = new THREE.DirectionalLight(0xffffff, 3);
  light.position.set(...sun);
  scene.add(mesh, light, new THREE.AmbientLight(0xffffff, 0.4));
  const eye = new THREE.PerspectiveCamera(camera.fovDeg, width / height, camera.near, camera.far);
  eye.up.set(0, 0, 1);
  const pixel = new Uint8Array(4);
  // WebGPU may be missing: three.js then draws with WebGL 2, and says so.
  const device = webgpu ? drawn.backend.device : undefined;
  return {
    facts: {
      version: THREE.REVISION,
      backend: device === undefined ? "webgl2" : "webgpu",
      triangles: indices.length / 3,
    },
    look(step) {
      eye.position.set(camera.eye[0] + step * camera.stepM, camera.eye[1], camera.eye[2]);
      eye.lookAt(camera.target[0] + step * camera.stepM, camera.target[1], camera.target[2]);
    },
    draw: () => drawn.render(scene, eye),
    async sync() {
      if (device !== undefined) await device.queue.onSubmittedWorkDone();
      else {
        const gl = drawn.getContext();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      }
    },
  };
}
