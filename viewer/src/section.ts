// The cut faces of a section. A ray that enters a solid through the section plane crosses one more back face than front faces. The remaining half of
// the robot is therefore drawn a second time, to a texture: a back face adds the colour of its part and 1, a front face subtracts them. What is left
// at a pixel is the colour of the solid that is cut there, and 1 (or the sums, for overlapping solids).

import {
  AddEquation, CustomBlending, DoubleSide, HalfFloatType, Mesh, MeshBasicMaterial, NearestFilter, OneFactor, type PerspectiveCamera, type Plane, PlaneGeometry,
  type Scene, ShaderMaterial, Vector2, Vector3, type WebGLRenderer, WebGLRenderTarget,
} from "three";

/** The layer of meshes that the section cuts. */
export const CUT = 1;
/** The approximate distance of the hatching lines [px]. */
const HATCHING = 14;

const VERTEX = /* glsl */ `
varying vec3 place;
void main() {
  place = (modelMatrix * vec4(position, 1.0)).xyz;
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
}
`;
const FRAGMENT = /* glsl */ `
uniform sampler2D sums;
uniform vec2 size;
uniform float hatching;
varying vec3 place;
void main() {
  vec4 sum = texture2D(sums, gl_FragCoord.xy / size);
  if (sum.a < 0.05) discard;
  float across = (place.x + place.y + place.z) / hatching;
  float line = 1.0 - smoothstep(0.05, 0.05 + 1.5 * fwidth(across), abs(fract(across) - 0.5));
  vec3 color = mix(sum.rgb / sum.a, vec3(0.3), 0.3);
  gl_FragColor = vec4(mix(color, 0.45 * color, 0.7 * line), min(sum.a, 1.0));
  #include <colorspace_fragment>
}
`;

export class Section {
  /** The mesh of the cut face. */
  readonly face: Mesh<PlaneGeometry, ShaderMaterial>;
  private readonly sums = new WebGLRenderTarget(1, 1, { type: HalfFloatType, samples: 4, depthBuffer: false, minFilter: NearestFilter, magFilter: NearestFilter });
  private readonly counting: MeshBasicMaterial;
  private readonly size = new Vector2();

  /** The side of the plane to which its normal points remains visible. */
  constructor(private readonly renderer: WebGLRenderer, private readonly plane: Plane) {
    this.counting = new MeshBasicMaterial({
      side: DoubleSide, transparent: true, forceSinglePass: true, depthTest: false, depthWrite: false, clippingPlanes: [plane], toneMapped: false,
      blending: CustomBlending, blendEquation: AddEquation, blendSrc: OneFactor, blendDst: OneFactor,
    });
    this.counting.onBeforeCompile = (shader) => {
      shader.fragmentShader = shader.fragmentShader.replace(
        "#include <opaque_fragment>", "gl_FragColor = (gl_FrontFacing ? -1.0 : 1.0) * vec4(diffuseColor.rgb, 1.0);",
      );
    };
    this.face = new Mesh(new PlaneGeometry(2, 2), new ShaderMaterial({
      vertexShader: VERTEX, fragmentShader: FRAGMENT, transparent: true, side: DoubleSide,
      uniforms: { sums: { value: this.sums.texture }, size: { value: this.size }, hatching: { value: 1 } },
    }));
    this.face.frustumCulled = false;
    this.face.visible = false;
  }

  /** Computes the cut face before a frame, if the camera can see it. `middle` and `radius` [m] describe a sphere around the robot. */
  prepare(scene: Scene, camera: PerspectiveCamera, middle: Vector3, radius: number): void {
    const { renderer, face, plane, sums } = this;
    const { extensions } = renderer;
    face.visible = plane.distanceToPoint(camera.position) < 0 && (extensions.has("EXT_color_buffer_float") || extensions.has("EXT_color_buffer_half_float"));
    if (!face.visible) return;
    plane.projectPoint(middle, face.position);
    face.quaternion.setFromUnitVectors(new Vector3(0, 0, 1), plane.normal);
    face.scale.setScalar(1.5 * radius);
    renderer.getDrawingBufferSize(this.size);
    sums.setSize(this.size.x, this.size.y);
    const pixel = (2 * camera.position.distanceTo(face.position) * Math.tan((camera.fov * Math.PI) / 360)) / renderer.domElement.clientHeight;
    face.material.uniforms.hatching.value = 2 ** Math.round(Math.log2(HATCHING * pixel)) * Math.SQRT2;
    const { mask } = camera.layers;
    camera.layers.set(CUT);
    scene.overrideMaterial = this.counting;
    renderer.setRenderTarget(sums);
    renderer.setClearAlpha(0);
    renderer.clear();
    renderer.render(scene, camera);
    renderer.setRenderTarget(null);
    scene.overrideMaterial = null;
    camera.layers.mask = mask;
  }
}
