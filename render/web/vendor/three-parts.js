// What the player takes of three.js; `vendor/build.sh` makes one file of it.
export {
  BufferGeometry, ClampToEdgeWrapping, DataArrayTexture, DataTexture, DoubleSide, Float32BufferAttribute, FloatType,
  GLSL3, HalfFloatType, LinearFilter, LinearMipmapLinearFilter, LinearSRGBColorSpace, Matrix4, Mesh, NearestFilter,
  NoBlending, NoColorSpace, OrthographicCamera, PerspectiveCamera, PlaneGeometry, RGBAFormat, RGFormat, RawShaderMaterial,
  RedFormat, Scene, ShaderMaterial, Sphere, Texture, UnsignedByteType, Vector2, Vector3, WebGLRenderTarget, WebGLRenderer,
} from 'three';
export { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
export { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
