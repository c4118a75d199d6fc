// What all peers offer to `esker bench render`: open, draw frames, read the picture. One page draws one peer.
//
// open(kind, ground) -> facts; frames(count, moving) draws and waits for the device after each; picture() -> PNG.
// Camera and ground are given in metres, x east, y north, z up.
import { openCesium } from "./cesium.js";
import { openThree } from "./three.js";

const OPENERS = {
  "three-webgl": (ground) => openThree(ground, { webgpu: false, displace: false }),
  "three-webgl-displacement": (ground) => openThree(ground, { webgpu: false, displace: true }),
  "three-webgpu": (ground) => openThree(ground, { webgpu: true, displace: false }),
  cesium: openCesium,
};

let peer = null;

async function open(kind, ground) {
  const heights = new Float32Array(await (await fetch(ground.url)).arrayBuffer());
  peer = await OPENERS[kind]({ ...ground, heights });
  return peer.facts;
}

async function frames(count, moving) {
  const began = performance.now();
  for (let i = 0; i < count; i += 1) {
    peer.look(moving ? i : 0);
    peer.draw();
    await peer.sync();
  }
  return (performance.now() - began) / count;
}

globalThis.peer = { open, frames, facts: () => peer.facts };
