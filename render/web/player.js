// The page: loads model.glb beside it, shows it, lets it be turned.
//
// Options in the address: ?camera={…} an exact camera as JSON (see `setCamera`), ?up=y the axis that points up
// (x, y, z, -x, -y, -z; what the export was told, else the ring's, else z), ?supersample=N sub-samples along a pixel's side,
// ?memory=MIB of textures that the model may take.
//
// Programs find `window.turnlight`: `ready` (a promise), `setCamera`, `screenshot`, `benchmark`, `state`.

import {
  GLSL3,
  LinearSRGBColorSpace,
  Matrix4,
  Mesh,
  NearestFilter,
  OrthographicCamera,
  PerspectiveCamera,
  PlaneGeometry,
  RawShaderMaterial,
  Scene,
  Sphere,
  Vector3,
  WebGLRenderTarget,
  WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { EXTENSION, ModelError, TurnlightPlugin, checkContainer } from './turnlight-loader.js';

const MODEL = 'model.glb';
const NAMES = { static: 'Static texture', vdtm: 'View-dependent texture mapping (VDTM)', lumigraph: 'Unstructured lumigraph', dyntex: 'Dynamic texture (DynTex)' };
const BACKGROUND = [27, 29, 33];
const FIELD_OF_VIEW_DEG = 30;
const TURN_SECONDS = 12;
/** Sine of an elevation that does not tell above from below. */
const LEVEL = 0.1;
const MOST_SUPERSAMPLE = 8;
/** Radians that an arrow key turns by. */
const STEP = Math.PI / 36;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
/** Frames slower than this, several in a row, lower the supersampling. */
const SLOW_MS = 40;

const $ = (id) => document.getElementById(id);
const query = new URLSearchParams(location.search);

// ---------------------------------------------------------------------------------------------------------
// Drawing: sub-samples into a target of their own, then their mean, both on encoded values.

const RESOLVE = `
precision highp float;
precision highp sampler2D;
uniform sampler2D samples;
uniform int side;
uniform vec3 background;
layout(location = 0) out vec4 result;
void main() {
  ivec2 first = ivec2(gl_FragCoord.xy) * side;
  vec4 sum = vec4(0.0);
  for (int y = 0; y < side; y++) for (int x = 0; x < side; x++) sum += texelFetch(samples, first + ivec2(x, y), 0);
  float all = float(side * side);
  result = vec4((sum.rgb + (all - sum.a) * background) / all, 1.0);
}`;

class Stage {
  constructor(canvas) {
    this.renderer = new WebGLRenderer({ canvas, antialias: false, depth: false, powerPreference: 'high-performance' });
    this.renderer.setPixelRatio(1);
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.setClearColor(0x000000, 0);
    this.scene = new Scene();
    this.samples = new WebGLRenderTarget(1, 1, { minFilter: NearestFilter, magFilter: NearestFilter });
    this.uniforms = { samples: { value: this.samples.texture }, side: { value: 1 }, background: { value: new Vector3(...BACKGROUND).divideScalar(255) } };
    const vertexShader = 'in vec3 position;\nvoid main() { gl_Position = vec4(position.xy, 0.0, 1.0); }';
    const material = new RawShaderMaterial({ vertexShader, fragmentShader: RESOLVE, uniforms: this.uniforms, glslVersion: GLSL3, depthTest: false, depthWrite: false });
    const cover = new Mesh(new PlaneGeometry(2, 2), material);
    cover.frustumCulled = false;
    this.resolve = new Scene().add(cover);
    this.flat = new OrthographicCamera();
  }

  /** Pixels of the canvas, and sub-samples along a pixel's side. */
  setSize(width, height, side) {
    const most = this.renderer.capabilities.maxTextureSize;
    const fit = Math.max(1, Math.min(side, Math.floor(most / Math.max(width, height, 1))));
    this.renderer.setSize(width, height, false);
    this.samples.setSize(width * fit, height * fit);
    this.uniforms.side.value = fit;
  }

  draw(camera) {
    this.renderer.setRenderTarget(this.samples);
    this.renderer.clear();
    this.renderer.render(this.scene, camera);
    this.renderer.setRenderTarget(null);
    this.renderer.render(this.resolve, this.flat);
  }

  /** Waits until everything that was drawn is there. */
  finish() {
    const gl = this.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
}

// ---------------------------------------------------------------------------------------------------------
// Loading

/** A file as it arrives. */
class Arrival {
  constructor(total) {
    this.bytes = new Uint8Array(total || 2 ** 20);
    this.at = 0;
    this.waiting = [];
  }

  add(part) {
    if (this.at + part.length > this.bytes.length) {
      const more = new Uint8Array(Math.max(2 * this.bytes.length, this.at + part.length));
      more.set(this.sofar);
      this.bytes = more;
    }
    this.bytes.set(part, this.at);
    this.at += part.length;
    this.waiting = this.waiting.filter(({ end, resolve }) => end > this.at || resolve());
  }

  get sofar() {
    return this.bytes.subarray(0, this.at);
  }

  /** Some bytes, once they are here. */
  async range(start, count) {
    if (start + count > this.at) await new Promise((resolve, reject) => this.waiting.push({ end: start + count, resolve, reject }));
    return this.bytes.subarray(start, start + count);
  }

  /** Nothing more comes. */
  end() {
    this.waiting.forEach(({ reject }) => reject(cutOff()));
    this.waiting = [];
  }
}

const cutOff = () => new ModelError('it is cut off');

/** The file at `address`, part by part; `onpart(arrival, share or null)`. */
async function download(address, onpart) {
  const response = await fetch(address).catch(() => null);
  if (!response?.ok) throw new ModelError(`${address} is not there (${response ? response.status : 'no answer'})`);
  const total = Number(response.headers.get('content-length')) || 0;
  const arrival = new Arrival(total);
  const reader = response.body.getReader();
  try {
    for (let step = await reader.read(); !step.done; step = await reader.read()) {
      arrival.add(step.value);
      await onpart(arrival, total ? arrival.at / total : null);
    }
  } finally {
    arrival.end();
  }
  return arrival;
}

/** The JSON of a binary glTF and where its data begin; null while it has not all come. */
function header(bytes) {
  if (bytes.length < 20) return null;
  const data = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (data.getUint32(0, true) !== 0x46546c67) throw new ModelError('it is no binary glTF');
  const length = data.getUint32(12, true);
  if (data.getUint32(16, true) !== 0x4e4f534a) throw new ModelError('its first part is not the description that must come first');
  if (bytes.length < 28 + length) return null;
  let json;
  try {
    json = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + length)));
  } catch {
    throw new ModelError('its description does not parse');
  }
  return { json, start: 28 + length, length: data.getUint32(8, true) };
}

/** Refuses what no model of ours looks like, before any of it is used. */
function checkShape({ json }) {
  if (typeof json !== 'object' || json === null || !json.asset?.version) throw new ModelError('its description is no glTF');
  checkContainer(json);
  const lone = ['scenes', 'nodes', 'meshes', 'materials'].find((part) => json[part]?.length !== 1 || !json[part][0]);
  if (lone) throw new ModelError(`of ${lone} it has none or several, where a model has one`);
  if (!json.materials[0].extensions?.[EXTENSION]) throw new ModelError(`its material has no extension ${EXTENSION}`);
  const [node, primitives] = [json.nodes[0], json.meshes[0].primitives];
  const extra = ['animations', 'skins', 'cameras'].find((part) => part in json);
  if (extra) throw new ModelError(`it has ${extra}, which a model has not`);
  const isPlain = Object.keys(node).every((key) => ['mesh', 'name'].includes(key)) && node.mesh === 0;
  const isAlone = primitives?.length === 1 && primitives[0] && !primitives[0].targets && !json.meshes[0].weights;
  const isSeen = (json.scene ?? 0) === 0 && JSON.stringify(json.scenes[0].nodes) === '[0]';
  if (!isPlain || !isAlone || !isSeen) throw new ModelError('it is more than one mesh where it was photographed');
  if (json.extensionsRequired?.length) throw new ModelError(`it needs the extension ${json.extensionsRequired[0]}`);
}

/**
 * Where all that is not a layer ends: mesh, picture, facets and their weights. From there on the model can be shown,
 * and its layers as they arrive. The end of the file where that cannot be told: the fault is named then.
 */
function endOfFirstLook({ json, start, length }) {
  const e = json.materials[0].extensions[EXTENSION];
  const { attributes, indices } = json.meshes[0].primitives[0];
  const texture = json.materials[0].pbrMetallicRoughness?.baseColorTexture?.index;
  const accessors = [attributes?.POSITION, attributes?.TEXCOORD_0, indices, e.facets, e.facetCenters, e.directions];
  accessors.push(e.triangles, e.edges, e.coefficients, e.cameraCenters);
  const images = [json.textures?.[texture]?.source, e.facetMap];
  const views = [[accessors, json.accessors], [images, json.images]].flatMap(([numbers, parts]) =>
    numbers.filter((i) => i !== undefined).map((i) => json.bufferViews?.[parts?.[i]?.bufferView]),
  );
  const end = start + Math.max(...views.map((view) => (view?.byteOffset ?? 0) + view?.byteLength));
  return end <= length ? end : length;
}

/** The first bytes of a model as a binary glTF of their own. */
function beginning(bytes, { start }, end) {
  const first = new Uint8Array(start + 4 * Math.ceil((end - start) / 4));
  first.set(bytes.subarray(0, end));
  const data = new DataView(first.buffer);
  data.setUint32(8, first.length, true);
  data.setUint32(start - 8, first.length - start, true);
  return first;
}

async function parse(loader, bytes) {
  try {
    return await loader.parseAsync(bytes.buffer, './');
  } catch (fault) {
    throw fault instanceof ModelError ? fault : new ModelError(`it is no glTF that can be read (${fault?.message ?? fault})`);
  }
}

// ---------------------------------------------------------------------------------------------------------
// The player

class Player {
  constructor() {
    this.stage = new Stage($('view'));
    this.camera = new PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.01, 100);
    this.takeControls();
    this.exact = null;
    this.isStale = true;
    const asked = Math.round(Number(query.get('supersample')));
    this.side = Math.min(Math.max(asked, 0), MOST_SUPERSAMPLE) || (devicePixelRatio > 1.5 ? 1 : 2);
    this.times = [];
    this.slow = 0;
    this.listen();
    this.resize();
    requestAnimationFrame((now) => this.frame(now));
  }

  listen() {
    addEventListener('resize', () => this.resize());
    $('look').onclick = () => this.toggleLook();
    $('spin').onclick = () => this.toggleSpin();
    $('home').onclick = () => this.home();
    $('save').onclick = () => this.save();
    const keys = { l: $('look'), ' ': $('spin'), Home: $('home'), s: $('save') };
    addEventListener('keydown', (event) => {
      if (event.target.tagName === 'BUTTON' && event.key === ' ') return;
      if (event.ctrlKey || event.metaKey) return;
      if (keys[event.key]) keys[event.key].click();
      else if (event.key in ARROWS) this.nudge(...ARROWS[event.key]);
    });
    $('view').addEventListener('webglcontextlost', (event) => {
      event.preventDefault();
      refuse('The graphics hardware gave up; load the page again.');
    });
  }

  resize() {
    if (this.exact) return;
    const ratio = Math.min(devicePixelRatio, 2);
    this.stage.setSize(Math.max(1, Math.round(innerWidth * ratio)), Math.max(1, Math.round(innerHeight * ratio)), this.side);
    this.camera.aspect = innerWidth / Math.max(innerHeight, 1);
    // The narrower side keeps its angle: phones are held upright.
    const half = Math.tan((FIELD_OF_VIEW_DEG * Math.PI) / 360);
    this.camera.fov = (360 / Math.PI) * Math.atan(half / Math.min(this.camera.aspect, 1));
    this.camera.updateProjectionMatrix();
    this.isStale = true;
  }

  /** Puts a loaded model on the stage. */
  show(gltf) {
    const [appearance] = gltf.userData.turnlight;
    this.stage.scene.add(gltf.scene);
    this.appearance = appearance;
    appearance.material.uniforms.encoded.value = true;
    appearance.onchange = () => (this.isStale = true);
    gltf.scene.traverse((o) => o.isMesh && this.enclose(o.geometry));
    this.home();
  }

  enclose(geometry) {
    geometry.computeBoundingSphere();
    this.sphere = geometry.boundingSphere;
    if (!(this.sphere.radius > 0)) this.sphere = new Sphere(this.sphere.center, 1);
  }

  /** The first view: from where it was photographed, with the axis of its turntable upright. */
  home() {
    if (!this.sphere) return;
    const { center, radius } = this.sphere;
    const up = axis(query.get('up') ?? document.body.dataset.up) ?? ringUp(this.appearance) ?? new Vector3(0, 0, 1);
    const from = this.appearance.directions[0] ?? new Vector3(1, -1, 0.6).normalize();
    const distance = (1.08 * radius) / Math.sin((FIELD_OF_VIEW_DEG * Math.PI) / 360);
    this.camera.up.copy(up);
    this.camera.position.copy(center).addScaledVector(from, distance);
    Object.assign(this.camera, { near: radius / 50, far: 60 * radius });
    this.camera.updateProjectionMatrix();
    this.takeControls();
    Object.assign(this.controls, { minDistance: 1.05 * radius, maxDistance: 40 * radius });
    this.controls.target.copy(center);
    this.controls.update();
    this.isStale = true;
  }

  /** Controls read what is up when they are made, so each first view makes its own. */
  takeControls() {
    const autoRotate = this.controls?.autoRotate ?? false;
    this.controls?.dispose();
    this.controls = new OrbitControls(this.camera, $('view'));
    Object.assign(this.controls, { enableDamping: true, dampingFactor: 0.06, rotateSpeed: 0.7 });
    Object.assign(this.controls, { autoRotate, autoRotateSpeed: 60 / TURN_SECONDS, enablePan: false });
    this.controls.addEventListener('change', () => (this.isStale = true));
  }

  /** Turns by steps, right and up. */
  nudge(right, up) {
    const { target } = this.controls;
    const arm = this.camera.position.clone().sub(target);
    const side = this.camera.up.clone().cross(arm).normalize();
    const polar = arm.angleTo(this.camera.up);
    arm.applyAxisAngle(side, Math.min(Math.max(polar - up * STEP, 1e-3), Math.PI - 1e-3) - polar);
    this.camera.position.copy(target).add(arm.applyAxisAngle(this.camera.up, right * STEP));
  }

  toggleLook() {
    if (!this.appearance || this.appearance.total === 1) return;
    this.appearance.isLive = !this.appearance.isLive;
    $('look').ariaPressed = String(!this.appearance.isLive);
    this.isStale = true;
  }

  toggleSpin() {
    this.controls.autoRotate = !this.controls.autoRotate;
    $('spin').ariaPressed = String(this.controls.autoRotate);
  }

  save() {
    const link = document.createElement('a');
    link.download = 'turnlight.png';
    link.href = this.screenshot();
    link.click();
  }

  /**
   * Looks through an exact camera, and fixes the size of the picture: keys and axes as in a transforms.json
   * (`transform_matrix` camera to world, x right, y up, z back; `fl_x`, `fl_y`, `cx`, `cy`, `w`, `h` in pixels).
   * Lenses are left out. null gives the camera back to the hand.
   */
  setCamera(asked) {
    this.exact = asked === null ? null : exactCamera(asked, this.sphere);
    document.body.classList.toggle('exact', this.exact !== null);
    this.controls.enabled = this.exact === null;
    const style = $('view').style;
    [style.width, style.height] = asked === null ? ['', ''] : [`${asked.w}px`, `${asked.h}px`];
    if (asked === null) this.resize();
    else this.stage.setSize(asked.w, asked.h, this.side);
    this.draw();
  }

  draw() {
    this.isStale = false;
    this.stage.draw(this.exact ?? this.camera);
    if (this.appearance?.fault) refuse(`This model is refused: ${this.appearance.fault.message}.`);
  }

  /** The picture now, as the address of a PNG. */
  screenshot() {
    this.draw();
    return $('view').toDataURL('image/png');
  }

  /** Milliseconds of each of `count` frames over a turn, each waited for. */
  benchmark(count = 60) {
    const camera = (this.exact ?? this.camera).clone();
    camera.matrixAutoUpdate = camera.matrixWorldAutoUpdate = false;
    const { x, y, z } = this.sphere.center;
    const step = new Matrix4().makeTranslation(x, y, z);
    step.multiply(new Matrix4().makeRotationAxis(this.camera.up, (2 * Math.PI) / count));
    step.multiply(new Matrix4().makeTranslation(-x, -y, -z));
    return Array.from({ length: count }, () => {
      camera.matrixWorld.premultiply(step);
      camera.matrixWorldInverse.copy(camera.matrixWorld).invert();
      const start = performance.now();
      this.stage.draw(camera);
      this.stage.finish();
      return performance.now() - start;
    });
  }

  get state() {
    const a = this.appearance;
    if (!a) return null;
    return { method: a.method, ready: a.ready, total: a.total, isPlaying: a.isPlaying, notice: a.notice, supersample: this.stage.uniforms.side.value };
  }

  frame(now) {
    requestAnimationFrame((next) => this.frame(next));
    if (!this.exact) this.controls.update();
    const wasStale = this.isStale;
    if (this.isStale) this.draw();
    this.measure(now, wasStale);
    this.report();
  }

  /** Keeps the times between frames while the picture moves; lowers the supersampling where they are long. */
  measure(now, isMoving) {
    const last = this.last;
    this.last = isMoving ? now : undefined;
    if (!isMoving || last === undefined) return;
    this.times.push(now - last);
    if (this.times.length > 30) this.times.shift();
    this.slow = now - last > SLOW_MS ? this.slow + 1 : 0;
    if (this.slow > 20 && this.side > 1 && !this.exact && !query.has('supersample')) {
      this.side = 1;
      this.slow = 0;
      this.resize();
    }
  }

  report() {
    const a = this.appearance;
    if (!a) return;
    const layers = a.method === 'lumigraph' ? 'rays per texel' : a.total === 1 ? 'layer' : 'layers';
    const count = a.ready < a.total && a.notice === null ? `${a.ready} of ${a.total}` : a.total;
    const sorted = [...this.times].sort((x, y) => x - y);
    const rate = sorted.length > 5 ? ` · ${Math.round(1000 / sorted[sorted.length >> 1])} frames/s` : '';
    say('method', a.isLive || a.total === 1 ? NAMES[a.method] : `${NAMES[a.method]}, static look`);
    say('figures', `${count} ${layers} · atlas ${a.part.size.join('×')}${rate}`);
    const shown = a.part.materials > 0 ? 'Its materials are painted on, as seen and lit from straight above.' : '';
    say('notice', a.notice === null ? shown : `Static look: ${a.notice}.`);
  }
}

function axis(name) {
  const match = /^(-?)([xyz])$/.exec(name ?? '');
  if (!match) return null;
  return new Vector3(...['x', 'y', 'z'].map((a) => (a === match[2] ? (match[1] ? -1 : 1) : 0)));
}

/** The axis of a turntable, turned to the side from which the object was seen; towards z where that was from level. */
function ringUp(appearance) {
  const ring = appearance.part.ringAxis;
  if (!ring) return null;
  const { directions } = appearance;
  const height = directions.reduce((sum, d) => sum + ring.dot(d), 0) / Math.max(directions.length, 1);
  return ring.clone().multiplyScalar((Math.abs(height) > LEVEL ? height : ring.z) < 0 ? -1 : 1);
}

/** A camera of three from one of a transforms.json. */
function exactCamera({ transform_matrix: m, fl_x, fl_y, cx, cy, w, h }, sphere) {
  const numbers = [...(m ?? []).flat(), fl_x, fl_y, cx, cy, w, h];
  if (numbers.length !== 22 || !numbers.every(Number.isFinite) || w < 1 || h < 1) {
    throw new Error('a camera has transform_matrix (4 × 4), fl_x, fl_y, cx, cy, w and h');
  }
  const camera = new PerspectiveCamera();
  camera.matrixAutoUpdate = camera.matrixWorldAutoUpdate = false;
  camera.matrixWorld.set(...m.flat());
  camera.matrixWorldInverse.copy(camera.matrixWorld).invert();
  const away = new Vector3().setFromMatrixPosition(camera.matrixWorld).distanceTo(sphere.center);
  const [near, far] = [Math.max(away - 1.1 * sphere.radius, 1e-3 * sphere.radius), away + 1.1 * sphere.radius];
  // Clip space out of camera space with y up and z back, pixel (0, 0) the outer corner at the top left.
  camera.projectionMatrix.set(
    (2 * fl_x) / w, 0, 1 - (2 * cx) / w, 0,
    0, (2 * fl_y) / h, (2 * cy) / h - 1, 0,
    0, 0, -(far + near) / (far - near), (-2 * far * near) / (far - near),
    0, 0, -1, 0,
  );
  camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
  return camera;
}

function say(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

/** The end: says why, and shows nothing of the model. */
function refuse(text) {
  say('message', text);
  $('loading').classList.add('refused');
  $('loading').hidden = false;
  $('bar').hidden = true;
  $('panel').hidden = $('tools').hidden = true;
  $('view').hidden = true;
}

async function start() {
  say('message', 'Loading');
  $('bar').hidden = false;
  let player;
  try {
    player = new Player();
  } catch {
    refuse('This browser has no WebGL 2, which the player needs.');
    throw new ModelError('no WebGL 2');
  }
  try {
    await load(player);
  } catch (fault) {
    refuse(`This model is refused: ${fault instanceof ModelError ? fault.message : `it cannot be read (${fault?.message ?? fault})`}.`);
    throw fault;
  }
  return player;
}

async function load(player) {
  const mostBytes = (Number(query.get('memory')) || 512) * 2 ** 20;
  let [head, shown] = [null, null];
  const show = async (arrival, end) => {
    const source = (start, count) => arrival.range(head.start + start, count);
    const options = { mostBytes, source, length: head.length - head.start };
    const loader = new GLTFLoader().register((parser) => new TurnlightPlugin(parser, options));
    player.show(await parse(loader, beginning(arrival.sofar, head, end)));
    $('panel').hidden = $('tools').hidden = false;
    $('look').hidden = player.appearance.total === 1;
  };
  const arrival = await download(MODEL, async (arrival, share) => {
    $('done').style.width = `${100 * (share ?? 0.5)}%`;
    if (head === null && (head = header(arrival.sofar))) checkShape(head);
    if (head === null || shown !== null) return;
    const end = endOfFirstLook(head);
    if (arrival.at >= end) await (shown = show(arrival, end));
  });
  if (head === null || arrival.at !== head.length) throw cutOff();
  await (shown ?? show(arrival, arrival.at));
  $('loading').hidden = true;
  if (query.has('camera')) lookThrough(player, query.get('camera'));
}

function lookThrough(player, text) {
  try {
    player.setCamera(JSON.parse(text));
  } catch (fault) {
    refuse(`The camera in the address is not understood: ${fault.message}.`);
  }
}

const ready = start();
window.turnlight = {
  /** Resolves when the whole file has come and its static look is on the screen; rejects where the model is refused. */
  ready: ready.then(() => undefined),
  /** Resolves when every layer is on the GPU, or when it is known that they will not be. */
  complete: async () => {
    const player = await ready;
    while (player.appearance.ready < player.appearance.total && player.appearance.notice === null) {
      player.draw();
      await new Promise((resolve) => setTimeout(resolve, 10));
    }
    player.draw();
    return player.state;
  },
  setCamera: async (camera) => (await ready).setCamera(camera),
  screenshot: async () => (await ready).screenshot(),
  benchmark: async (count) => (await ready).benchmark(count),
};
// Said on the page already.
ready.catch(() => {});
window.turnlight.ready.catch(() => {});
