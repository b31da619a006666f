// Reads and plays TURNLIGHT_view_dependent_texture, as a plugin of three.js' GLTFLoader.
//
//   import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
//   import { TurnlightPlugin } from './turnlight-loader.js';
//   const loader = new GLTFLoader().register((parser) => new TurnlightPlugin(parser));
//   const gltf = await loader.loadAsync('model.glb');
//   scene.add(gltf.scene);       // plays by itself, for every camera that looks at it
//   gltf.userData.turnlight;     // one Appearance per material that carries the extension
//
// This file needs nothing but three. The format is specified in docs/model-format.md.
//
// Two steps, as everywhere in Turnlight. For the eye: weights of layers per facet, in JavaScript, once per
// frame. For the surface: `Σ_k w_k (offset_k + scale_k · layer_k)` for every texel of the atlas, on the GPU,
// into a texture of half floats with mip-maps, which is then drawn like any other. Blending first and
// filtering afterwards is what the format asks for: no filter mixes two facets before they are blended.
//
// Reading trusts nothing: a file is checked before anything is decoded, and no address in it is followed.

import {
  BufferGeometry,
  ClampToEdgeWrapping,
  DataArrayTexture,
  DataTexture,
  DoubleSide,
  Float32BufferAttribute,
  FloatType,
  GLSL3,
  HalfFloatType,
  LinearFilter,
  LinearMipmapLinearFilter,
  Mesh,
  NearestFilter,
  NoBlending,
  NoColorSpace,
  OrthographicCamera,
  RGBAFormat,
  RGFormat,
  RawShaderMaterial,
  RedFormat,
  Scene,
  ShaderMaterial,
  Texture,
  UnsignedByteType,
  Vector2,
  Vector3,
  WebGLRenderTarget,
} from 'three';

/** The name of our extension. */
export const EXTENSION = 'TURNLIGHT_view_dependent_texture';

/** The only version read. */
const VERSION = 1;

/** As the other readers: no atlas has more texels, or a longer side. */
const MOST_TEXELS = 2 ** 26;
const LONGEST_SIDE = 2 ** 15;

/** Rays blended for one texel. */
const BLENDED = 4;

/** The atlas is padded to a multiple of this, so that its first six mip levels are boxes of 2 × 2 texels. */
const PADDING = 64;

const FLOAT = 5126;
const UNSIGNED_INT = 5125;
const UNSIGNED_SHORT = 5123;
const SHORT = 5122;

/** A file that is refused; the message says why. */
export class ModelError extends Error {}

/** Plugin of GLTFLoader: `loader.register((parser) => new TurnlightPlugin(parser, options))`. */
export class TurnlightPlugin {
  /**
   * `options.mostBytes`: texture memory that an appearance may take on the GPU; 512 MiB unless told.
   * `options.source`, with `options.length`: for a file that is still arriving. What is parsed is then its beginning,
   * up to all that is not a layer; the binary chunk will have `length` bytes, and `await source(start, count)` gives
   * some of them.
   */
  constructor(parser, options = {}) {
    this.name = EXTENSION;
    this.parser = parser;
    this.options = options;
    /** Material index → what the extension says, checked. */
    this.parts = new Map();
  }

  /** Checks everything that can be checked without decoding an image. */
  async beforeRoot() {
    const { json, extensions } = this.parser;
    const carriers = list(json.materials).flatMap((m, i) => (m?.extensions?.[EXTENSION] ? [i] : []));
    if (carriers.length === 0) return;
    const body = extensions.KHR_binary_glTF?.body;
    if (!body) throw new ModelError('it is no binary glTF with all its data inside');
    checkContainer(json);
    const reader = new Reader(json, body, this.options);
    for (const index of carriers) this.parts.set(index, await readExtension(reader, index));
  }

  /** Hands the meshes their appearances. */
  async afterRoot(gltf) {
    const appearances = [];
    const associations = this.parser.associations;
    for (const [index, part] of this.parts) {
      const preview = await this.parser.getDependency('texture', part.texture);
      if (!preview) throw new ModelError('its preview cannot be decoded');
      const appearance = new Appearance(part, preview, this.options);
      const found = [];
      gltf.scene.traverse((o) => {
        if (o.isMesh && associations.get(o.material)?.materials === index) found.push(o);
      });
      found.forEach((mesh) => appearance.attach(mesh));
      appearances.push(appearance);
    }
    if (appearances.length > 0) gltf.userData.turnlight = appearances;
  }
}

// ---------------------------------------------------------------------------------------------------------
// Reading

const list = (value) => (Array.isArray(value) ? value : []);
const isIndex = (value) => Number.isInteger(value) && value >= 0;
const isFinite3 = (value) => Array.isArray(value) && value.length === 3 && value.every(Number.isFinite);

/** Refuses a glTF that is not all in one file. */
export function checkContainer(json) {
  if (list(json.buffers).length !== 1 || 'uri' in json.buffers[0]) {
    throw new ModelError('a buffer lies outside the file; models name no other files');
  }
  list(json.images).forEach((image, i) => {
    if (typeof image !== 'object' || image === null || 'uri' in image) {
      throw new ModelError(`image ${i} lies outside the file; models name no other files`);
    }
  });
}

/** Bytes of a binary glTF by the numbers of its JSON. */
class Reader {
  constructor(json, body, { source, length }) {
    this.json = json;
    this.body = body;
    this.source = source;
    this.length = length ?? body.byteLength;
  }

  /** Where a buffer view begins, and how long it is. */
  range(index) {
    const view = list(this.json.bufferViews)[index];
    if (typeof view !== 'object' || view === null) throw new ModelError(`buffer view ${index} is missing`);
    const [start, length] = [view.byteOffset ?? 0, view.byteLength];
    if (view.buffer !== 0) throw new ModelError(`buffer view ${index} lies in another buffer`);
    if (!isIndex(start) || !isIndex(length)) throw new ModelError(`buffer view ${index} has no range`);
    if (start + length > this.length) throw new ModelError(`buffer view ${index} reaches past the end of the file`);
    return [start, length];
  }

  view(index) {
    const [start, length] = this.range(index);
    if (start + length > this.body.byteLength) throw new ModelError(`buffer view ${index} has not arrived`);
    return new Uint8Array(this.body, start, length);
  }

  /** The elements of a packed accessor, `per` numbers each. */
  accessor(index, component, kind, per, what) {
    const accessor = isIndex(index) ? list(this.json.accessors)[index] : undefined;
    if (typeof accessor !== 'object' || accessor === null) throw new ModelError(`it has no ${what}`);
    if (accessor.componentType !== component || accessor.type !== kind) {
      throw new ModelError(`its ${what} are not ${kind} of component type ${component}`);
    }
    const Numbers = { [FLOAT]: Float32Array, [UNSIGNED_INT]: Uint32Array, [UNSIGNED_SHORT]: Uint16Array, [SHORT]: Int16Array }[component];
    const width = per * Numbers.BYTES_PER_ELEMENT;
    const stride = list(this.json.bufferViews)[accessor.bufferView]?.byteStride ?? width;
    if (stride !== width || accessor.sparse) throw new ModelError(`its ${what} are sparse or interleaved, which is not read`);
    const bytes = this.view(accessor.bufferView);
    const [offset, count] = [accessor.byteOffset ?? 0, accessor.count];
    if (!isIndex(offset) || !isIndex(count) || offset + count * width > bytes.length) {
      throw new ModelError(`its ${what} count more elements than the file holds`);
    }
    // A copy: the view need not be aligned.
    return new Numbers(bytes.slice(offset, offset + count * width).buffer);
  }

  /** As `accessor`, but absent where there is nothing to say. */
  part(index, ...rest) {
    return index === undefined ? new Uint16Array(0) : this.accessor(index, ...rest);
  }

  floats(index, kind, per, what) {
    const values = this.accessor(index, FLOAT, kind, per, what);
    if (!values.every(Number.isFinite)) throw new ModelError(`its ${what} hold a value that is no number`);
    return values;
  }

  /** The bytes of an image, whose header must say `size`. */
  image(index, size, what) {
    return checkImage(this.view(this.#viewOfImage(index, what)), size, what);
  }

  /** The same for one that may not have arrived: a function that waits for it. */
  imageLater(index, size, what) {
    const view = this.#viewOfImage(index, what);
    if (!this.source) {
      const bytes = this.image(index, size, what);
      return async () => bytes;
    }
    const range = this.range(view);
    return async () => checkImage(await this.source(...range), size, what);
  }

  #viewOfImage(index, what) {
    const image = isIndex(index) ? list(this.json.images)[index] : undefined;
    if (!isIndex(image?.bufferView)) throw new ModelError(`${what} is not inside the file`);
    return image.bufferView;
  }
}

function checkImage(bytes, size, what) {
  const [width, height] = sizeOfImage(bytes) ?? [];
  if (width === undefined) throw new ModelError(`${what} is neither PNG nor JPEG`);
  if (width !== size[0] || height !== size[1]) {
    throw new ModelError(`${what} is ${width}×${height} where ${size[0]}×${size[1]} is declared`);
  }
  return bytes;
}

/** Width and height that the header of a PNG or JPEG declares. */
function sizeOfImage(bytes) {
  const data = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length >= 24 && data.getUint32(0) === 0x89504e47) return [data.getUint32(16), data.getUint32(20)];
  if (bytes.length < 4 || data.getUint16(0) !== 0xffd8) return undefined;
  for (let at = 2; at + 9 <= bytes.length; ) {
    const marker = data.getUint16(at);
    // Start of frame, of any kind; C4, C8 and CC share the range and are none.
    const isFrame = marker >= 0xffc0 && marker <= 0xffcf && ![0xffc4, 0xffc8, 0xffcc].includes(marker);
    if (isFrame) return [data.getUint16(at + 7), data.getUint16(at + 5)];
    if (marker >> 8 !== 0xff) return undefined;
    at += marker === 0xffff ? 1 : 2 + data.getUint16(at + 2);
  }
  return undefined;
}

/** What the extension of material `index` says, in arrays that can be trusted; images still coded. */
async function readExtension(reader, index) {
  const material = reader.json.materials[index];
  const e = material.extensions[EXTENSION];
  if (e.version !== VERSION) throw new ModelError(`version ${e.version} of the extension; this player reads version ${VERSION}`);
  if (!['static', 'vdtm', 'dyntex', 'lumigraph'].includes(e.method)) throw new ModelError(`no method '${e.method}'`);
  const size = e.atlasSize;
  const isSide = (side) => isIndex(side) && side >= 1 && side <= LONGEST_SIDE;
  if (!Array.isArray(size) || size.length !== 2 || !size.every(isSide) || size[0] * size[1] > MOST_TEXELS) {
    throw new ModelError(`an atlas of ${JSON.stringify(size)} texels`);
  }
  refuseSharedImages(reader, e);
  const texture = material.pbrMetallicRoughness?.baseColorTexture?.index;
  reader.image(list(reader.json.textures)[texture]?.source, size, 'its preview');
  const mesh = readMesh(reader, index);
  const part = { method: e.method, size, texture, mesh, materials: list(e.materials).length, coated: coatedFaces(mesh, e) };
  if (e.method === 'lumigraph') return Object.assign(part, readRays(reader, e, size));
  return Object.assign(part, await readLayers(reader, e, size));
}

/** Layers that share one image would let a small file ask for any memory. */
function refuseSharedImages(reader, e) {
  const images = [...list(e.layers).map((l) => l?.image), ...list(e.rays).flatMap((r) => [r?.color, r?.view])];
  let bytes = 0;
  for (const image of images) bytes += list(reader.json.bufferViews)[list(reader.json.images)[image]?.bufferView]?.byteLength ?? 0;
  // What is missing counts nothing here, and is named when it is read; so is what is no number.
  if (!(bytes <= reader.length)) throw new ModelError('its layers share images');
}

/** Positions, texture coordinates and faces of the one primitive that wears material `index`. */
function readMesh(reader, index) {
  const primitives = list(reader.json.meshes).flatMap((mesh) => list(mesh?.primitives));
  const wearers = primitives.filter((p) => (p?.material ?? -1) === index);
  if (wearers.length !== 1) throw new ModelError(`${wearers.length} primitives wear its material, where one must`);
  const [primitive] = wearers;
  if ((primitive.mode ?? 4) !== 4) throw new ModelError('its mesh is not made of triangles');
  const positions = reader.floats(primitive.attributes?.POSITION, 'VEC3', 3, 'positions');
  const uvs = reader.floats(primitive.attributes?.TEXCOORD_0, 'VEC2', 2, 'texture coordinates');
  const faces = reader.accessor(primitive.indices, UNSIGNED_INT, 'SCALAR', 1, 'faces');
  const vertices = positions.length / 3;
  if (uvs.length !== 2 * vertices) throw new ModelError(`${uvs.length / 2} texture coordinates for ${vertices} positions`);
  const wild = faces.find((v) => v >= vertices);
  if (wild !== undefined) throw new ModelError(`a face names vertex ${wild} of ${vertices}`);
  if (!uvs.every((v) => v >= -1e-6 && v <= 1 + 1e-6)) throw new ModelError('a texture coordinate lies outside the atlas');
  return { positions, uvs, faces };
}

/** Of each face whether a material lies on its chart: charts are what hangs together by vertices, numbered by first faces. */
function coatedFaces({ positions, faces }, e) {
  const coated = new Uint8Array(faces.length / 3);
  const laid = new Set();
  for (const material of list(e.materials)) {
    const charts = new Set(list(material?.charts));
    if (charts.size === 0) throw new ModelError('a material lies on no chart');
    for (const chart of charts) {
      if (laid.has(chart)) throw new ModelError(`two materials lie on chart ${chart}`);
      laid.add(chart);
    }
  }
  if (laid.size === 0) return coated;
  const parent = Uint32Array.from({ length: positions.length / 3 }, (_, v) => v);
  const root = (v) => {
    while (parent[v] !== v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (let i = 0; i < faces.length; i += 3) {
    for (const v of [faces[i + 1], faces[i + 2]]) parent[root(v)] = root(faces[i]);
  }
  const charts = new Map();
  for (let f = 0; f < coated.length; f++) {
    const chart = root(faces[3 * f]);
    if (!charts.has(chart)) charts.set(chart, charts.size);
    coated[f] = laid.has(charts.get(chart)) ? 1 : 0;
  }
  for (const chart of laid) {
    if (!isIndex(chart) || chart >= charts.size) {
      throw new ModelError(`a material lies on chart ${chart}; the model has ${charts.size} charts`);
    }
  }
  return coated;
}

async function readLayers(reader, e, size) {
  const layers = list(e.layers).map((layer, k) => {
    if (!Number.isFinite(layer?.scale) || !Number.isFinite(layer?.offset)) {
      throw new ModelError(`layer ${k} has a scale or offset that is no number`);
    }
    return { read: reader.imageLater(layer.image, size, `layer ${k}`), scale: layer.scale, offset: layer.offset };
  });
  if (layers.length === 0) throw new ModelError('it has no layers');
  const facets = readFacets(reader, e, layers.length);
  const map = await decodePng(reader.image(e.facetMap, size, 'its facet map'), size, 'its facet map');
  const facetOfTexel = new Uint16Array(size[0] * size[1]);
  for (let i = 0; i < facetOfTexel.length; i++) facetOfTexel[i] = map[3 * i] | (map[3 * i + 1] << 8);
  const wild = facetOfTexel.find((f) => f >= facets.length);
  if (wild !== undefined) throw new ModelError(`a texel names facet ${wild} of ${facets.length}`);
  return { layers, facets, facetOfTexel, ringAxis: e.ringAxis && new Vector3(...e.ringAxis) };
}

/** The complexes of directions and the coefficients of all facets. */
function readFacets(reader, e, layers) {
  const counts = reader.accessor(e.facets, UNSIGNED_SHORT, 'VEC4', 4, 'facets');
  const centers = reader.floats(e.facetCenters, 'VEC3', 3, 'facet centres');
  const count = counts.length / 4;
  if (centers.length !== 3 * count) throw new ModelError(`${centers.length / 3} centres for ${count} facets`);
  const scales = e.coefficientScales;
  if (list(scales).length !== layers || !scales.every(Number.isFinite)) {
    throw new ModelError('its coefficient scales do not fit its layers');
  }
  const axis = e.ringAxis;
  if (axis !== undefined && (!isFinite3(axis) || Math.abs(Math.hypot(...axis) - 1) > 1e-3)) {
    throw new ModelError('its ring axis is no unit vector');
  }
  const take = {
    directions: taker(reader.part(e.directions, SHORT, 'VEC3', 3, 'directions'), 'directions'),
    triangles: taker(reader.part(e.triangles, UNSIGNED_SHORT, 'SCALAR', 1, 'triangles'), 'triangles'),
    edges: taker(reader.part(e.edges, UNSIGNED_SHORT, 'SCALAR', 1, 'edges'), 'edges'),
    coefficients: taker(reader.part(e.coefficients, SHORT, 'SCALAR', 1, 'coefficients'), 'coefficients'),
  };
  return Array.from({ length: count }, (_, n) => {
    const [s, t, d, rank] = counts.subarray(4 * n, 4 * n + 4);
    if (rank === 0 || rank > layers) throw new ModelError(`facet ${n} uses ${rank} of ${layers} layers`);
    const complex = new DirectionComplex(take.directions(3 * s), take.triangles(3 * t), take.edges(2 * d), axis);
    if (!complex.isSound()) throw new ModelError(`facet ${n} has an unsound triangulation`);
    const table = Float32Array.from(take.coefficients(s * rank), (y, i) => snorm(y) * scales[i % rank]);
    return { center: centers.subarray(3 * n, 3 * n + 3), complex, rank, table };
  });
}

/** Elements handed out in order. */
function taker(values, what) {
  let at = 0;
  return (count) => {
    if (at + count > values.length) throw new ModelError(`its facets want more ${what} than there are`);
    at += count;
    return values.subarray(at - count, at);
  };
}

/** A normalised 16-bit integer of glTF. */
const snorm = (v) => Math.max(v / 32767, -1);

function readRays(reader, e, size) {
  const centers = reader.floats(e.cameraCenters, 'VEC3', 3, 'camera centres');
  const rays = list(e.rays).map((ray, k) => ({
    color: reader.imageLater(ray?.color, size, `ray colours ${k}`),
    view: reader.imageLater(ray?.view, size, `ray views ${k}`),
  }));
  if (rays.length === 0) throw new ModelError('it has no rays');
  return { rays, centers };
}

/**
 * 8-bit RGB of a PNG, exactly as stored. Browsers may colour-manage, and some add noise to, what a canvas
 * gives back; numbers of facets and views must come through unharmed.
 */
async function decodePng(bytes, [width, height], what) {
  const fault = () => new ModelError(`${what} is no PNG of 8-bit RGB without interlace`);
  const data = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const isPlain = bytes.length > 29 && data.getUint32(0) === 0x89504e47 && data.getUint32(24) === 0x08020000 && bytes[28] === 0;
  if (!isPlain) throw fault();
  const parts = [];
  for (let at = 8; at + 12 <= bytes.length; ) {
    const [length, kind] = [data.getUint32(at), data.getUint32(at + 4)];
    if (at + 12 + length > bytes.length) throw new ModelError(`${what} is cut off`);
    if (kind === 0x49444154) parts.push(bytes.subarray(at + 8, at + 8 + length));
    at += 12 + length;
  }
  const rows = await inflate(parts, (3 * width + 1) * height, what);
  const out = new Uint8Array(3 * width * height);
  for (let y = 0; y < height; y++) {
    if (!unfilter(rows, out, y, 3 * width)) throw fault();
  }
  return out;
}

/** Exactly `length` bytes out of a zlib stream; stops where it holds more. */
async function inflate(parts, length, what) {
  const out = new Uint8Array(length);
  let at = 0;
  try {
    const reader = new Blob(parts).stream().pipeThrough(new DecompressionStream('deflate')).getReader();
    for (let step = await reader.read(); !step.done; step = await reader.read()) {
      if (at + step.value.length > length) {
        reader.cancel().catch(() => {});
        at = -1;
        break;
      }
      out.set(step.value, at);
      at += step.value.length;
    }
  } catch {
    at = -1;
  }
  if (at !== length) throw new ModelError(`${what} does not decompress to its size`);
  return out;
}

/** Undoes the filter of row `y` (PNG specification, 9.2), three bytes a pixel; false for a filter that is not known. */
function unfilter(rows, out, y, stride) {
  const [from, to] = [y * (stride + 1) + 1, y * stride];
  const filter = rows[from - 1];
  if (filter > 4) return false;
  for (let x = 0; x < stride; x++) {
    const left = x >= 3 ? out[to + x - 3] : 0;
    const above = y > 0 ? out[to + x - stride] : 0;
    let guess = 0;
    if (filter === 1) guess = left;
    else if (filter === 2) guess = above;
    else if (filter === 3) guess = (left + above) >> 1;
    else if (filter === 4) guess = paeth(left, above, x >= 3 && y > 0 ? out[to + x - stride - 3] : 0);
    out[to + x] = rows[from + x] + guess;
  }
  return true;
}

function paeth(a, b, c) {
  const [pa, pb, pc] = [Math.abs(b - c), Math.abs(a - c), Math.abs(a + b - 2 * c)];
  if (pa <= pb && pa <= pc) return a;
  return pb <= pc ? b : c;
}

// ---------------------------------------------------------------------------------------------------------
// First step: weights for an eye

/**
 * Sites on the unit sphere and the simplices between them. A query is carried to the nearest point of the
 * complex and answered by the corners of the simplex it falls on.
 */
class DirectionComplex {
  constructor(directions, triangles, edges, axis) {
    this.triangles = triangles;
    this.edges = edges;
    this.axis = axis;
    this.sites = new Float64Array(directions.length);
    for (let i = 0; i < directions.length; i += 3) {
      const d = [0, 1, 2].map((k) => snorm(directions[i + k]));
      const norm = Math.hypot(...d);
      // Zero, which is not sound, where a stored direction is far from unit length.
      this.sites.set(d.map((v) => (norm > 0.5 ? v / norm : 0)), i);
    }
    this.inverses = this.isSound() ? this.#invert() : null;
    /** Site and weight, up to three; what `blend` fills in. */
    this.picked = [0, 0, 0];
    this.shares = [0, 0, 0];
  }

  get length() {
    return this.sites.length / 3;
  }

  isSound() {
    const isUnit = (_, i) => i % 3 !== 0 || this.sites[i] !== 0 || this.sites[i + 1] !== 0 || this.sites[i + 2] !== 0;
    const isSite = (i) => i < this.length;
    return this.sites.every(isUnit) && this.triangles.every(isSite) && this.edges.every(isSite);
  }

  /** Rows give barycentric weights up to scale: the inverse of `[a b c]`, zero where there is none. */
  #invert() {
    const out = new Float64Array(3 * this.triangles.length);
    for (let t = 0; t < this.triangles.length; t += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => this.site(this.triangles[t + k]));
      const rows = [cross(b, c), cross(c, a), cross(a, b)];
      const det = dot(a, rows[0]);
      if (det !== 0) out.set(rows.flat().map((v) => v / det), 3 * t);
    }
    return out;
  }

  site(i) {
    return [this.sites[3 * i], this.sites[3 * i + 1], this.sites[3 * i + 2]];
  }

  /** Weights of the sites for a direction, which need not be unit, into `picked` and `shares`. */
  blend(x, y, z) {
    const norm = Math.hypot(x, y, z);
    if (!(norm > 1e-300) || norm === Infinity) return this.#pick(0);
    const d = [x / norm, y / norm, z / norm];
    if (this.axis) this.#byAzimuth(d);
    else if (!this.#inside(d)) this.#nearest(d);
  }

  #pick(i, a = 1, j = 0, b = 0, k = 0, c = 0) {
    this.picked[0] = i;
    this.picked[1] = j;
    this.picked[2] = k;
    this.shares[0] = a;
    this.shares[1] = b;
    this.shares[2] = c;
  }

  /** The edge that spans the azimuth of `d`; the site nearest in azimuth where none does. */
  #byAzimuth(d) {
    for (let e = 0; e < this.edges.length; e += 2) {
      const [i, j] = [this.edges[e], this.edges[e + 1]];
      const start = this.site(i);
      const [along, span] = [turn(start, d, this.axis), turn(start, this.site(j), this.axis)];
      if (span > 0 && along >= 0 && along <= span) return this.#pick(i, 1 - along / span, j, along / span);
    }
    let [best, least] = [0, Infinity];
    for (let i = 0; i < this.length; i++) {
      const off = Math.abs(turn(this.site(i), d, this.axis));
      if (off < least) [best, least] = [i, off];
    }
    this.#pick(best);
  }

  /** Barycentric weights in the triangle around `d`; false outside all triangles. */
  #inside(d) {
    const m = this.inverses;
    for (let t = 0; t < m.length; t += 9) {
      const a = m[t] * d[0] + m[t + 1] * d[1] + m[t + 2] * d[2];
      if (a < -1e-12) continue;
      const b = m[t + 3] * d[0] + m[t + 4] * d[1] + m[t + 5] * d[2];
      const c = m[t + 6] * d[0] + m[t + 7] * d[1] + m[t + 8] * d[2];
      if (b < -1e-12 || c < -1e-12 || a + b + c <= 1e-12) continue;
      const [u, v, w] = [Math.max(a, 0), Math.max(b, 0), Math.max(c, 0)];
      const sum = u + v + w;
      const corner = t / 3;
      const sites = this.triangles;
      this.#pick(sites[corner], u / sum, sites[corner + 1], v / sum, sites[corner + 2], w / sum);
      return true;
    }
    return false;
  }

  /** The nearest point of the edges, and of the sites. */
  #nearest(d) {
    let best = -Infinity;
    for (let i = 0; i < this.length; i++) {
      const cosine = dot(this.site(i), d);
      if (cosine > best) {
        best = cosine;
        this.#pick(i);
      }
    }
    for (let e = 0; e < this.edges.length; e += 2) {
      const [i, j] = [this.edges[e], this.edges[e + 1]];
      const foot = projectToArc(d, this.site(i), this.site(j));
      if (foot && foot[0] > best) {
        best = foot[0];
        this.#pick(i, 1 - foot[1], j, foot[1]);
      }
    }
  }
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** The angle in −π..=π by which the azimuth of `to` about `axis` is ahead of that of `from`. */
function turn(from, to, axis) {
  const along = dot(axis, from);
  const flat = [from[0] - axis[0] * along, from[1] - axis[1] * along, from[2] - axis[2] * along];
  return Math.atan2(dot(axis, cross(flat, to)), dot(flat, to));
}

/** Foot of the perpendicular from `d` on the great arc from `a` to `b`: its cosine to `d`, its share of the arc. */
function projectToArc(d, a, b) {
  const normal = unit(cross(a, b));
  if (!normal) return null;
  const off = dot(normal, d);
  const foot = unit([d[0] - normal[0] * off, d[1] - normal[1] * off, d[2] - normal[2] * off]);
  if (!foot) return null;
  const span = Math.atan2(Math.hypot(...cross(a, b)), dot(a, b));
  const along = Math.atan2(dot(normal, cross(a, foot)), dot(a, foot));
  return along >= 0 && along <= span ? [dot(foot, d), along / span] : null;
}

function unit(v) {
  const norm = Math.hypot(...v);
  return norm > 1e-12 ? v.map((x) => x / norm) : null;
}

// ---------------------------------------------------------------------------------------------------------
// Second step: the atlas

const COVER = /* glsl */ `
in vec3 position;
void main() { gl_Position = vec4(position, 1.0); }`;

const HEAD = /* glsl */ `
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
layout(location = 0) out vec4 result;`;

/** Layers: a facet has pairs of numbers: bias and how many layers it shows, then gain and layer of each. */
const BLEND_LAYERS = /* glsl */ `${HEAD}
uniform sampler2DArray layers;
uniform sampler2D facets;
uniform sampler2D weights;
uniform ivec2 last;
uniform int row;
vec2 pair(int i) {
  int width = textureSize(weights, 0).x;
  return texelFetch(weights, ivec2(i % width, i / width), 0).rg;
}
void main() {
  ivec2 at = min(ivec2(gl_FragCoord.xy), last);
  vec2 code = texelFetch(facets, at, 0).rg * 255.0;
  int start = int(code.r + 256.0 * code.g + 0.5) * row;
  vec2 head = pair(start);
  vec3 sum = vec3(head.x);
  int end = start + int(head.y);
  for (int i = start + 1; i <= end; i++) {
    vec2 term = pair(i);
    sum += term.x * texelFetch(layers, ivec3(at, int(term.y)), 0).rgb;
  }
  result = vec4(sum, 1.0);
}`;

/** Rays: colour and the low byte of the view in one texel; view 255 (65535) is none. */
const BLEND_RAYS = /* glsl */ `${HEAD}
uniform sampler2DArray rays;
#ifdef WIDE
uniform sampler2DArray high;
#endif
uniform sampler2D points;
uniform sampler2D centers;
uniform vec3 eye;
int view(ivec3 at, float low) {
#ifdef WIDE
  int v = int(low * 255.0 + 0.5) + 256 * int(texelFetch(high, at, 0).r * 255.0 + 0.5);
  return v == 65535 ? -1 : v;
#else
  int v = int(low * 255.0 + 0.5);
  return v == 255 ? -1 : v;
#endif
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec3 p = texelFetch(points, at, 0).xyz;
  vec3 toEye = normalize(eye - p);
  float pens[${BLENDED + 1}];
  vec3 colors[${BLENDED + 1}];
  for (int i = 0; i <= ${BLENDED}; i++) pens[i] = 1e30;
  int count = 0;
  int width = textureSize(centers, 0).x;
  for (int k = 0; k < SLOTS; k++) {
    vec4 ray = texelFetch(rays, ivec3(at, k), 0);
    int v = view(ivec3(at, k), ray.a);
    if (v < 0) continue;
    count++;
    vec3 c = texelFetch(centers, ivec2(v % width, v / width), 0).xyz;
    float pen = length(normalize(c - p) - toEye);
    vec3 color = ray.rgb;
    for (int i = 0; i <= ${BLENDED}; i++) {
      if (pen < pens[i]) {
        float otherPen = pens[i]; vec3 otherColor = colors[i];
        pens[i] = pen; colors[i] = color;
        pen = otherPen; color = otherColor;
      }
    }
  }
  if (count == 0) { result = vec4(0.0); return; }
  float threshold = count > ${BLENDED} ? pens[${BLENDED}] : 1.01 * pens[count - 1] + 1e-12;
  vec3 sum = vec3(0.0);
  float total = 0.0;
  for (int i = 0; i < min(count, ${BLENDED}); i++) {
    float w = max(0.0, 1.0 - pens[i] / threshold) / max(pens[i], 1e-6) + 1e-9;
    sum += w * colors[i];
    total += w;
  }
  result = vec4(sum / total, 1.0);
}`;

/** Push: the mean of the known among 2 × 2; alpha 1 is known. */
const PUSH = /* glsl */ `${HEAD}
uniform sampler2D fine;
void main() {
  ivec2 size = textureSize(fine, 0);
  ivec2 first = 2 * ivec2(gl_FragCoord.xy);
  vec4 sum = vec4(0.0);
  for (int y = 0; y < 2; y++) for (int x = 0; x < 2; x++) {
    ivec2 at = first + ivec2(x, y);
    if (at.x < size.x && at.y < size.y) { vec4 t = texelFetch(fine, at, 0); sum += t.a > 0.5 ? vec4(t.rgb, 1.0) : vec4(0.0); }
  }
  result = sum.a > 0.0 ? vec4(sum.rgb / sum.a, 1.0) : vec4(0.0);
}`;

/** Pull: what is unknown takes 9, 3, 3 and 1 sixteenths of the level above. */
const PULL = /* glsl */ `${HEAD}
uniform sampler2D fine;
uniform sampler2D coarse;
void main() {
  ivec2 at = min(ivec2(gl_FragCoord.xy), textureSize(fine, 0) - 1);
  vec4 own = texelFetch(fine, at, 0);
  if (own.a > 0.5) { result = own; return; }
  ivec2 size = textureSize(coarse, 0);
  ivec2 a = at / 2;
  ivec2 b = clamp(a + 2 * (at & 1) - 1, ivec2(0), size - 1);
  vec3 sum = 9.0 * texelFetch(coarse, a, 0).rgb + 3.0 * texelFetch(coarse, ivec2(b.x, a.y), 0).rgb;
  sum += 3.0 * texelFetch(coarse, ivec2(a.x, b.y), 0).rgb + texelFetch(coarse, b, 0).rgb;
  result = vec4(sum / 16.0, 1.0);
}`;

/** A shader over a whole target. */
class Pass {
  constructor(fragmentShader, uniforms, defines = {}) {
    const wrapped = Object.fromEntries(Object.entries(uniforms).map(([name, value]) => [name, { value }]));
    const geometry = new BufferGeometry().setAttribute('position', new Float32BufferAttribute([-1, -1, 0, 3, -1, 0, -1, 3, 0], 3));
    this.material = new RawShaderMaterial({
      vertexShader: COVER,
      fragmentShader,
      uniforms: wrapped,
      defines,
      glslVersion: GLSL3,
      depthTest: false,
      depthWrite: false,
      blending: NoBlending,
    });
    this.uniforms = wrapped;
    this.scene = new Scene();
    const mesh = new Mesh(geometry, this.material);
    mesh.frustumCulled = false;
    this.scene.add(mesh);
    this.camera = new OrthographicCamera();
  }

  draw(renderer, target) {
    renderer.setRenderTarget(target);
    renderer.render(this.scene, this.camera);
  }

  dispose() {
    this.material.dispose();
    this.scene.children[0].geometry.dispose();
  }
}

/** Draws passes in the middle of somebody else's frame, and leaves no trace. */
function aside(renderer, camera, work) {
  const kept = [renderer.getRenderTarget(), renderer.getActiveCubeFace(), renderer.getActiveMipmapLevel()];
  const [xr, shadows, clears] = [renderer.xr.enabled, renderer.shadowMap.autoUpdate, renderer.autoClear];
  renderer.xr.enabled = false;
  renderer.shadowMap.autoUpdate = false;
  renderer.autoClear = false;
  work();
  renderer.xr.enabled = xr;
  renderer.shadowMap.autoUpdate = shadows;
  renderer.autoClear = clears;
  renderer.setRenderTarget(...kept);
  if (camera?.viewport !== undefined) renderer.state.viewport(camera.viewport);
}

function exactTarget(renderer, width, height, options = {}) {
  const isFloat = renderer.extensions.has('EXT_color_buffer_float') || renderer.extensions.has('EXT_color_buffer_half_float');
  return new WebGLRenderTarget(width, height, {
    type: isFloat ? HalfFloatType : UnsignedByteType,
    minFilter: NearestFilter,
    magFilter: NearestFilter,
    depthBuffer: false,
    ...options,
  });
}

/** An array of 8-bit textures that is filled layer by layer. */
function emptyArray([width, height], depth, format = RGBAFormat) {
  const texture = new DataArrayTexture(null, width, height, depth);
  Object.assign(texture, { format, type: UnsignedByteType, minFilter: NearestFilter, magFilter: NearestFilter });
  Object.assign(texture, { generateMipmaps: false, unpackAlignment: 1 });
  texture.source.dataReady = false;
  texture.needsUpdate = true;
  return texture;
}

function putLayer(renderer, array, k, source) {
  source.unpackAlignment = 1;
  renderer.copyTextureToTexture(source, array, null, new Vector3(0, 0, k));
  source.dispose();
}

/** Numbers as a texture about as wide as `width`. */
function numberTexture(count, channels, width = 1024) {
  const columns = Math.min(Math.max(count, 1), width);
  const rows = Math.ceil(Math.max(count, 1) / columns);
  const data = new Float32Array(columns * rows * channels);
  return new DataTexture(data, columns, rows, channels === 2 ? RGFormat : RGBAFormat, FloatType);
}

/** Layers and weights per facet: static texture, VDTM, DynTex. */
class LayerBlend {
  constructor(part) {
    this.part = part;
    this.slots = part.layers.length;
    this.row = this.slots + 1;
    this.array = emptyArray(part.size, this.slots);
    this.weights = numberTexture(part.facets.length * this.row, 2);
    this.sums = new Float64Array(this.slots);
    const [width, height] = part.size;
    const codes = new Uint8Array(4 * width * height);
    part.facetOfTexel.forEach((f, i) => {
      codes[4 * i] = f & 255;
      codes[4 * i + 1] = f >> 8;
    });
    this.facets = new DataTexture(codes, width, height);
    this.facets.needsUpdate = true;
    this.pass = new Pass(BLEND_LAYERS, {
      layers: this.array,
      facets: this.facets,
      weights: this.weights,
      last: new Vector2(width - 1, height - 1),
      row: this.row,
    });
  }

  static bytes(part) {
    return 4 * part.size[0] * part.size[1] * (part.layers.length + 1);
  }

  static deepest(part) {
    return part.layers.length;
  }

  /** A truncated basis is a coarser picture; source views make sense together alone. */
  get leastSlots() {
    return this.part.method === 'dyntex' ? 1 : this.slots;
  }

  async decode(k) {
    const bytes = await this.part.layers[k].read();
    const options = { colorSpaceConversion: 'none', premultiplyAlpha: 'none' };
    const bitmap = await createImageBitmap(new Blob([bytes]), options).catch(() => {
      throw new ModelError(`layer ${k} cannot be decoded`);
    });
    return (renderer) => {
      putLayer(renderer, this.array, k, new Texture(bitmap));
      bitmap.close();
    };
  }

  /** Weights for an eye, into the texture of numbers. Colours are shares of 255 there. */
  draw(renderer, target, eye, ready) {
    const out = this.weights.image.data;
    this.part.facets.forEach((facet, f) => {
      this.#weigh(facet, eye);
      this.#write(out, 2 * f * this.row, Math.min(facet.rank, ready));
    });
    this.weights.needsUpdate = true;
    this.pass.draw(renderer, target);
  }

  /** Weights of a facet's layers into `sums`. A facet without sites shows its first layer. */
  #weigh({ center, complex, rank, table }, eye) {
    this.sums.fill(0);
    if (complex.length === 0) {
      this.sums[0] = 1;
      return;
    }
    complex.blend(eye.x - center[0], eye.y - center[1], eye.z - center[2]);
    for (let n = 0; n < 3; n++) {
      const from = complex.picked[n] * rank;
      for (let k = 0; complex.shares[n] > 0 && k < rank; k++) this.sums[k] += complex.shares[n] * table[from + k];
    }
  }

  /** Writes what is not zero of the first `used` sums: gains and layers, behind their count and common bias. */
  #write(out, start, used) {
    let [at, bias] = [start, 0];
    for (let k = 0; k < used; k++) {
      if (this.sums[k] === 0) continue;
      const { scale, offset } = this.part.layers[k];
      at += 2;
      out[at] = this.sums[k] * scale;
      out[at + 1] = k;
      bias += this.sums[k] * offset;
    }
    out[start] = bias / 255;
    out[start + 1] = (at - start) / 2;
  }

  dispose() {
    [this.array, this.weights, this.facets, this.pass].forEach((held) => held.dispose());
  }
}

/** Rays per texel: the unstructured lumigraph. */
class RayBlend {
  constructor(part, renderer) {
    this.part = part;
    this.slots = part.rays.length;
    const [width, height] = part.size;
    const views = part.centers.length / 3;
    this.array = emptyArray(part.size, this.slots);
    // 255 is no ray, so a byte names 255 views.
    this.high = views > 255 ? emptyArray(part.size, this.slots, RedFormat) : null;
    this.centers = numberTexture(views, 4);
    for (let v = 0; v < views; v++) this.centers.image.data.set(part.centers.subarray(3 * v, 3 * v + 3), 4 * v);
    this.centers.needsUpdate = true;
    this.points = new DataTexture(surfacePoints(part.mesh, part.size), width, height, RGBAFormat, FloatType);
    this.points.needsUpdate = true;
    const uniforms = { rays: this.array, points: this.points, centers: this.centers, eye: new Vector3(), high: this.high };
    this.pass = new Pass(BLEND_RAYS, uniforms, { SLOTS: this.slots, ...(this.high && { WIDE: 1 }) });
    this.push = new Pass(PUSH, { fine: null });
    this.pull = new Pass(PULL, { fine: null, coarse: null });
    /** Levels of the atlas: as blended, and filled. */
    this.levels = [];
    for (let size = [width, height]; ; size = size.map((s) => Math.ceil(s / 2))) {
      this.levels.push({ known: exactTarget(renderer, ...size), filled: this.levels.length ? exactTarget(renderer, ...size) : null });
      if (size[0] * size[1] === 1) break;
    }
  }

  static bytes(part) {
    const texel = (part.centers.length > 3 * 255 ? 5 : 4) * part.rays.length + 16 + 8 * 3;
    return part.size[0] * part.size[1] * texel;
  }

  static deepest(part) {
    return part.rays.length;
  }

  get leastSlots() {
    return this.slots;
  }

  async decode(k) {
    const { size, rays } = this.part;
    const color = await decodePng(await rays[k].color(), size, `ray colours ${k}`);
    const view = await decodePng(await rays[k].view(), size, `ray views ${k}`);
    const texels = size[0] * size[1];
    const [packed, high] = [new Uint8Array(4 * texels), this.high && new Uint8Array(texels)];
    const views = this.part.centers.length / 3;
    for (let i = 0; i < texels; i++) {
      const index = view[3 * i] | (view[3 * i + 1] << 8);
      if (index !== 65535 && index >= views) throw new ModelError(`a ray names view ${index} of ${views}`);
      packed.set(color.subarray(3 * i, 3 * i + 3), 4 * i);
      packed[4 * i + 3] = index & 255;
      if (high) high[i] = index >> 8;
    }
    return (renderer) => {
      putLayer(renderer, this.array, k, new DataTexture(packed, ...size));
      if (high) putLayer(renderer, this.high, k, new DataTexture(high, ...size, RedFormat));
    };
  }

  /** Blends the rays of every texel, then fills the gutters by push and pull. */
  draw(renderer, target, eye) {
    this.pass.uniforms.eye.value.copy(eye);
    this.pass.draw(renderer, this.levels[0].known);
    const top = this.levels.length - 1;
    for (let l = 1; l <= top; l++) {
      this.push.uniforms.fine.value = this.levels[l - 1].known.texture;
      this.push.draw(renderer, this.levels[l].known);
    }
    for (let l = top - 1; l >= 0; l--) {
      const above = this.levels[l + 1];
      this.pull.uniforms.fine.value = this.levels[l].known.texture;
      this.pull.uniforms.coarse.value = (l + 1 === top ? above.known : above.filled).texture;
      this.pull.draw(renderer, l === 0 ? target : this.levels[l].filled);
    }
    if (top === 0) {
      this.pull.uniforms.fine.value = this.levels[0].known.texture;
      this.pull.uniforms.coarse.value = this.levels[0].known.texture;
      this.pull.draw(renderer, target);
    }
  }

  dispose() {
    this.levels.forEach(({ known, filled }) => [known, filled].forEach((t) => t?.dispose()));
    [this.array, this.high, this.centers, this.points, this.pass, this.push, this.pull].forEach((held) => held?.dispose());
  }
}

/**
 * The surface point behind every texel that a bilinear sampler can touch: that of the nearest triangle whose
 * open square of half-width 1 about the texel's centre it meets; RGBA, alpha 1 where there is one.
 */
function surfacePoints({ positions, uvs, faces }, [width, height]) {
  const points = new Float32Array(4 * width * height);
  const distances = new Float32Array(width * height).fill(Infinity);
  for (let f = 0; f < faces.length; f += 3) {
    const v = [faces[f], faces[f + 1], faces[f + 2]];
    const corners = v.map((i) => [uvs[2 * i] * width, uvs[2 * i + 1] * height]);
    const area = perp(corners[0], corners[1], corners[2]);
    if (area === 0) continue;
    const range = [0, 1].map((axis) => {
      const at = corners.map((c) => c[axis]);
      return [Math.max(Math.ceil(Math.min(...at) - 1.5), 0), Math.min(Math.floor(Math.max(...at) + 0.5) + 1, [width, height][axis])];
    });
    for (let y = range[1][0]; y < range[1][1]; y++) {
      for (let x = range[0][0]; x < range[0][1]; x++) {
        const [weights, distance] = nearestInTriangle(corners, area, [x + 0.5, y + 0.5]);
        const i = y * width + x;
        if (!(distance < distances[i])) continue;
        distances[i] = distance;
        for (let k = 0; k < 3; k++) {
          points[4 * i + k] = weights[0] * positions[3 * v[0] + k] + weights[1] * positions[3 * v[1] + k] + weights[2] * positions[3 * v[2] + k];
        }
        points[4 * i + 3] = 1;
      }
    }
  }
  return points;
}

/** Twice the signed area of a triangle. */
const perp = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);

/** Barycentric coordinates of the triangle's point nearest to `p`, and its squared distance. */
function nearestInTriangle(corners, area, p) {
  const [a, b, c] = corners;
  const [u, v] = [perp(b, c, p) / area, perp(c, a, p) / area];
  if (u >= 0 && v >= 0 && u + v <= 1) return [[u, v, 1 - u - v], 0];
  let best = [[1, 0, 0], Infinity];
  for (let k = 0; k < 3; k++) {
    const [from, to] = [corners[k], corners[(k + 1) % 3]];
    const edge = [to[0] - from[0], to[1] - from[1]];
    const along = (p[0] - from[0]) * edge[0] + (p[1] - from[1]) * edge[1];
    const t = Math.min(Math.max(along / Math.max(edge[0] ** 2 + edge[1] ** 2, Number.MIN_VALUE), 0), 1);
    const distance = (p[0] - from[0] - edge[0] * t) ** 2 + (p[1] - from[1] - edge[1] * t) ** 2;
    if (distance < best[1]) {
      const weights = [0, 0, 0];
      weights[k] = 1 - t;
      weights[(k + 1) % 3] = t;
      best = [weights, distance];
    }
  }
  return best;
}

// ---------------------------------------------------------------------------------------------------------
// Drawing

const SURFACE_VERTEX = /* glsl */ `
out vec2 at;
void main() {
  at = uv;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

/**
 * One trilinear lookup, the longer derivative deciding the level. Levels are mixed here: hardware may take
 * short cuts with both.
 */
const SURFACE_FRAGMENT = /* glsl */ `
uniform sampler2D atlas;
uniform vec2 size;
uniform vec2 padded;
uniform bool encoded;
in vec2 at;
void main() {
  vec2 texel = at * size;
  vec2 across = dFdx(texel), down = dFdy(texel);
  float squared = max(dot(across, across), dot(down, down));
  float level = squared > 1.0 ? 0.5 * log2(squared) : 0.0;
  float fine = floor(level);
  vec2 place = texel / padded;
  vec3 color = mix(textureLod(atlas, place, fine).rgb, textureLod(atlas, place, fine + 1.0).rgb, level - fine);
  color = clamp(color, 0.0, 1.0);
  if (encoded) { gl_FragColor = vec4(color, 1.0); return; }
  // Texels are sRGB as encoded; three works in linear light and encodes for the screen.
  gl_FragColor = sRGBTransferEOTF(vec4(color, 1.0));
  #include <colorspace_fragment>
}`;

/** How a surface looks from any eye; made by `TurnlightPlugin`, plays by itself. */
export class Appearance {
  constructor(part, preview, { mostBytes = 512 * 2 ** 20 }) {
    this.part = part;
    this.mostBytes = mostBytes;
    this.preview = preview;
    preview.colorSpace = NoColorSpace;
    preview.wrapS = preview.wrapT = ClampToEdgeWrapping;
    preview.minFilter = LinearMipmapLinearFilter;
    preview.magFilter = LinearFilter;
    preview.generateMipmaps = true;
    preview.needsUpdate = true;
    /** Whether the surface changes with the eye; false shows the static look. */
    this.isLive = true;
    /** Why the static look is shown although `isLive`; null where it is not. */
    this.notice = null;
    /** Called whenever the picture would change without the camera moving. */
    this.onchange = () => {};
    /** Layers (or rays) that have been decoded and are on the GPU. */
    this.ready = 0;
    this.decoded = [];
    const size = new Vector2(...part.size);
    const wear = (encoded) =>
      new ShaderMaterial({
        vertexShader: SURFACE_VERTEX,
        fragmentShader: SURFACE_FRAGMENT,
        uniforms: { atlas: { value: preview }, size: { value: size }, padded: { value: size }, encoded },
        glslVersion: null,
        side: DoubleSide,
        toneMapped: false,
      });
    this.material = wear({ value: false });
    /** The static look, which has materials painted on: charts that carry one keep it. */
    this.still = part.coated.includes(1) ? wear(this.material.uniforms.encoded) : null;
  }

  get method() {
    return this.part.method;
  }

  /** Layers, or rays per texel. */
  get total() {
    return (this.part.layers ?? this.part.rays).length;
  }

  /** Whether what is on the screen depends on the eye. */
  get isPlaying() {
    return this.isLive && this.notice === null && this.blend !== undefined && this.ready >= this.blend.leastSlots;
  }

  /** Directions, unit and from the object, in which it was photographed: those of the facet with most, or the cameras'. */
  get directions() {
    if (this.part.centers) {
      const [c, p] = [this.part.centers, this.part.mesh.positions];
      const middle = [0, 1, 2].map((k) => p.reduce((sum, v, i) => (i % 3 === k ? sum + v : sum), 0) / (p.length / 3));
      return Array.from({ length: c.length / 3 }, (_, i) => new Vector3(...middle.map((m, k) => c[3 * i + k] - m)).normalize());
    }
    const complexes = this.part.facets.map((f) => f.complex);
    const most = complexes.reduce((a, b) => (b.length > a.length ? b : a), complexes[0]);
    return Array.from({ length: most?.length ?? 0 }, (_, i) => new Vector3(...most.site(i)));
  }

  /** Dresses a mesh. */
  attach(mesh) {
    mesh.material.dispose();
    mesh.material = this.still === null ? this.material : [this.material, this.still];
    if (this.still !== null) this.#part(mesh.geometry);
    const eye = new Vector3();
    mesh.onBeforeRender = (renderer, _scene, camera) => {
      eye.setFromMatrixPosition(camera.matrixWorld);
      this.update(renderer, mesh.worldToLocal(eye), camera);
    };
  }

  /** Tells the faces apart that carry a material. */
  #part(geometry) {
    const { faces } = this.part.mesh;
    const corners = [0, 1].map((coated) => faces.filter((_, i) => this.part.coated[Math.trunc(i / 3)] === coated));
    geometry.clearGroups();
    geometry.index.array.set(corners[0]);
    geometry.index.array.set(corners[1], corners[0].length);
    geometry.addGroup(0, corners[0].length, 0);
    geometry.addGroup(corners[0].length, corners[1].length, 1);
    geometry.index.needsUpdate = true;
  }

  /** Makes the atlas for an eye in the coordinates of the mesh, unless it is that already. */
  update(renderer, eye, camera) {
    if (this.blend === undefined && this.notice === null) this.#prepare(renderer);
    const isNew = this.#upload(renderer);
    const { atlas, padded } = this.material.uniforms;
    if (!this.isPlaying) {
      atlas.value = this.preview;
      padded.value = this.material.uniforms.size.value;
      return;
    }
    if (isNew || !this.seen?.equals(eye)) {
      this.seen = (this.seen ?? new Vector3()).copy(eye);
      aside(renderer, camera, () => this.blend.draw(renderer, this.target, eye, this.ready));
    }
    atlas.value = this.target.texture;
    padded.value = this.padded;
  }

  #prepare(renderer) {
    const Blend = this.method === 'lumigraph' ? RayBlend : LayerBlend;
    this.notice = this.#unfit(renderer, Blend);
    if (this.notice !== null) return this.onchange();
    const size = this.part.size.map((side) => Math.ceil(side / PADDING) * PADDING);
    this.padded = new Vector2(...size);
    this.target = exactTarget(renderer, ...size, { minFilter: LinearMipmapLinearFilter, magFilter: LinearFilter, generateMipmaps: true });
    this.blend = new Blend(this.part, renderer);
    this.#decode();
  }

  /** Why the GPU cannot hold the appearance, or null. */
  #unfit(renderer, Blend) {
    const gl = renderer.getContext();
    const [side, depth] = [gl.getParameter(gl.MAX_TEXTURE_SIZE), gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS)];
    const [width, height] = this.part.size;
    if (Math.max(width, height) + PADDING > side) return `an atlas of ${width}×${height} texels, where the graphics hardware takes ${side}`;
    if (Blend.deepest(this.part) > depth) return `${Blend.deepest(this.part)} layers, where the graphics hardware takes ${depth}`;
    const bytes = Blend.bytes(this.part);
    const mega = (n) => `${Math.round(n / 2 ** 20)} MiB`;
    return bytes > this.mostBytes ? `${mega(bytes)} of textures, where ${mega(this.mostBytes)} are allowed` : null;
  }

  /** Decodes layer after layer; a few at once, since browsers decode in threads of their own. */
  async #decode() {
    let next = 0;
    const worker = async () => {
      while (next < this.total && this.notice === null) {
        const k = next++;
        this.decoded[k] = await this.blend.decode(k);
        this.onchange();
      }
    };
    try {
      await Promise.all([worker(), worker(), worker()]);
    } catch (fault) {
      this.fault = fault;
      this.notice = fault instanceof ModelError ? fault.message : 'a layer cannot be decoded';
      this.onchange();
    }
  }

  /** Takes decoded layers to the GPU, in order; whether there were any. */
  #upload(renderer) {
    const before = this.ready;
    while (this.decoded[this.ready]) {
      this.decoded[this.ready](renderer);
      this.decoded[this.ready] = null;
      this.ready += 1;
    }
    return this.ready > before;
  }

  dispose() {
    [this.material, this.still, this.preview, this.target, this.blend].forEach((held) => held?.dispose());
  }
}
