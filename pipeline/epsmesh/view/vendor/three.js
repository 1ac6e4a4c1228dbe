// What the pages use of three.js.
export {
  BoxGeometry, BufferAttribute, BufferGeometry, DoubleSide, GLSL3, InterleavedBuffer,
  InterleavedBufferAttribute, LatheGeometry, LineBasicMaterial, LineSegments, Matrix4, Mesh, OrthographicCamera, Raycaster, Scene,
  ShaderMaterial, Vector2, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
