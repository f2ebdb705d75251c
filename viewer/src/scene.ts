// SPDX-License-Identifier: Apache-2.0
// The object in 3D: simulated surface, observed cloud, the push. Draws only when something changed.
import {
  AmbientLight, BufferAttribute, BufferGeometry, CatmullRomCurve3, Color, ConeGeometry, CylinderGeometry, DirectionalLight, DoubleSide, Group,
  LineBasicMaterial, LineSegments, Mesh, MeshBasicMaterial, MeshLambertMaterial, PerspectiveCamera, Points, PointsMaterial,
  Quaternion, Scene, TubeGeometry, Vector3, WebGLRenderer, WireframeGeometry,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { observed, signedColour, sizeColour, unseen } from "./colours";
import type { Report, Step } from "./data";
import type { Field } from "./surface_fields";

export interface Visible {
  surface: boolean;
  mesh: boolean;
  cloud: boolean;
  masked: boolean;
  rest: boolean;
  push: boolean;
}

const arrowColour = new Color(0.72, 0.02, 0.3); // apart from both colour maps

export class View {
  readonly canvas: HTMLCanvasElement;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(35, 1, 0.001, 100);
  private readonly controls: OrbitControls;
  private readonly surfaceGeometry = new BufferGeometry();
  private readonly surface: Mesh;
  private readonly wire: LineSegments;
  private readonly rest: LineSegments;
  private readonly cloud: Points;
  private readonly masked: Points;
  private readonly push = new Group();
  private readonly lamp = new DirectionalLight(0xffffff, 1.7);
  private readonly size: number;
  private readonly centre: Vector3;
  private largestForce = 1;
  private pending = false;
  private frames = 0;
  private lastFrame = 0;
  private slowness = 0; // smoothed seconds a frame while frames follow each other
  private coarse = false;
  private settle = 0;

  /** @throws when the browser offers no WebGL */
  constructor(
    private readonly holder: HTMLElement,
    private report: Report,
  ) {
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", "The object in 3D. Drag or use the arrow keys to turn it, plus and minus to zoom.");
    holder.append(this.canvas);

    const box = boundsOf([report.rest, ...report.steps.map((s) => s.surface)]);
    this.centre = box.centre;
    this.size = box.size;
    this.use(report);

    const index = new BufferAttribute(report.triangles, 1);
    this.surfaceGeometry.setIndex(index);
    this.surfaceGeometry.setAttribute("position", new BufferAttribute(Float32Array.from(report.rest), 3));
    this.surfaceGeometry.setAttribute("color", new BufferAttribute(new Float32Array(report.rest.length), 3));
    // The surface steps back a little in depth, so that points that lie on it are seen.
    this.surface = new Mesh(
      this.surfaceGeometry,
      new MeshLambertMaterial({ vertexColors: true, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: 1.5, polygonOffsetUnits: 4 }),
    );
    this.wire = new LineSegments(edgesOf(report), new LineBasicMaterial({ color: 0x10151c, transparent: true, opacity: 0.28 }));
    (this.wire.geometry as BufferGeometry).setAttribute("position", this.surfaceGeometry.getAttribute("position"));
    const restGeometry = new BufferGeometry();
    restGeometry.setIndex(index);
    restGeometry.setAttribute("position", new BufferAttribute(Float32Array.from(report.rest), 3));
    this.rest = new LineSegments(new WireframeGeometry(restGeometry), new LineBasicMaterial({ color: 0x8b94a3, transparent: true, opacity: 0.22 }));
    this.cloud = new Points(new BufferGeometry(), new PointsMaterial({ size: 2.6, sizeAttenuation: false, vertexColors: true }));
    this.masked = new Points(new BufferGeometry(), new PointsMaterial({ size: 2, sizeAttenuation: false, color: 0x8b94a3 }));
    this.scene.add(this.surface, this.wire, this.rest, this.cloud, this.masked, this.push, new AmbientLight(0xffffff, 1.35), this.lamp);

    this.placeCamera();
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.target.copy(this.centre);
    this.controls.enableDamping = false;
    this.controls.zoomToCursor = true;
    this.controls.update();
    this.controls.addEventListener("change", () => this.draw());
    this.canvas.addEventListener("keydown", (event) => this.turn(event));
    new ResizeObserver(() => this.fit()).observe(holder);
    this.fit();
  }

  /** Later data of the same mesh; the camera stays where it is. */
  use(report: Report): void {
    this.report = report;
    this.largestForce = Math.max(1e-12, ...report.steps.map((s) => new Vector3(...s.force_n.map((f) => f ?? 0)).length()));
  }

  /** Gives the browser its drawing context back: it has few of them. */
  dispose(): void {
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  private placeCamera(): void {
    const gravity = new Vector3(...(this.report.scene?.gravity_m_s2 ?? [0, 0, 0]).map((g) => g ?? 0));
    const up = gravity.length() > 1e-6 ? gravity.normalize().negate() : new Vector3(0, 0, 1);
    // Look from the side that is pushed: the touched surface faces the reader.
    const push = new Vector3();
    for (const step of this.report.steps) push.add(new Vector3(...step.force_n.map((f) => f ?? 0)));
    const level = push.clone().negate().addScaledVector(up, push.dot(up));
    if (level.length() < 0.2 * push.length() || level.length() < 1e-12) {
      // Pushed from above: look from where the sensors looked.
      const seen = this.report.steps.find((s) => s.points && s.points.length > 0)?.points;
      level.set(1, -1.6, 0);
      if (seen) {
        level.set(0, 0, 0);
        for (let i = 0; i < seen.length; i += 3) level.add(new Vector3(seen[i], seen[i + 1], seen[i + 2]).sub(this.centre));
        level.divideScalar(seen.length / 3);
      }
      level.addScaledVector(up, -level.dot(up));
      if (level.length() < 0.02 * this.size) level.set(1, -1.6, 0).addScaledVector(up, -up.x + 1.6 * up.y);
      if (level.length() < 1e-6) level.set(0, 0, 1);
    }
    level.normalize().applyAxisAngle(up, 0.6);
    this.camera.up.copy(up);
    this.camera.position.copy(this.centre).addScaledVector(level, this.size * 2.3).addScaledVector(up, this.size * 1.0);
    this.camera.near = this.size / 200;
    this.camera.far = this.size * 30;
    this.camera.lookAt(this.centre);
  }

  private fit(): void {
    const [width, height] = [this.holder.clientWidth, this.holder.clientHeight];
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.fov = width < height ? 45 : 35;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private turn(event: KeyboardEvent): void {
    const turns: Record<string, [number, number, number]> = {
      ArrowLeft: [-0.12, 0, 1], ArrowRight: [0.12, 0, 1], ArrowUp: [0, -0.1, 1], ArrowDown: [0, 0.1, 1],
      "+": [0, 0, 0.88], "=": [0, 0, 0.88], "-": [0, 0, 1.14],
    };
    const turn = turns[event.key];
    if (!turn) return;
    event.preventDefault();
    const arm = this.camera.position.clone().sub(this.controls.target);
    const right = new Vector3().crossVectors(this.camera.up, arm).normalize();
    const turned = arm.clone().applyAxisAngle(this.camera.up, turn[0]).applyAxisAngle(right, turn[1]).multiplyScalar(turn[2]);
    const steep = Math.abs(turned.clone().normalize().dot(this.camera.up)) > 0.985;
    this.camera.position.copy(this.controls.target).add(steep ? arm : turned);
    this.controls.update();
    this.draw();
  }

  show(step: Step, field: Field, visible: Visible): void {
    const position = this.surfaceGeometry.getAttribute("position") as BufferAttribute;
    (position.array as Float32Array).set(step.surface ?? this.report.rest);
    position.needsUpdate = true;
    const colour = this.surfaceGeometry.getAttribute("color") as BufferAttribute;
    const values = field.values;
    for (let i = 0; i < values.length; ++i) {
      const share = field.scale > 0 ? values[i] / field.scale : 0;
      const [r, g, b] = Number.isNaN(values[i]) ? unseen : field.signed ? signedColour(share) : sizeColour(share);
      colour.setXYZ(i, linear(r), linear(g), linear(b));
    }
    colour.needsUpdate = true;
    this.surfaceGeometry.computeVertexNormals();
    this.surfaceGeometry.computeBoundingSphere();
    this.showCloud(step, field);
    this.showPush(step);
    this.surface.visible = visible.surface;
    this.wire.visible = visible.mesh;
    this.rest.visible = visible.rest;
    this.cloud.visible = visible.cloud;
    this.masked.visible = visible.masked;
    this.push.visible = visible.push;
    this.draw();
  }

  private showCloud(step: Step, field: Field): void {
    const used: number[] = [];
    const colours: number[] = [];
    const rejected: number[] = [];
    const coloured = field.signed && field.title.startsWith("residual");
    for (let i = 0; step.points && i < step.points.length / 3; ++i) {
      const residual = step.residual ? step.residual[i] : 0;
      const place = [step.points[3 * i], step.points[3 * i + 1], step.points[3 * i + 2]];
      if (Number.isNaN(residual)) {
        rejected.push(...place);
        continue;
      }
      used.push(...place);
      const [r, g, b] = coloured ? signedColour(residual / (field.scale || 1)) : observed;
      colours.push(linear(r), linear(g), linear(b));
    }
    if (step.masked) rejected.push(...step.masked);
    replace(this.cloud, used, colours);
    replace(this.masked, rejected);
  }

  private showPush(step: Step): void {
    this.push.clear();
    const force = new Vector3(...step.force_n.map((f) => f ?? 0));
    const strength = force.length();
    if (!(strength > 0) || step.contact_m.some((c) => c === null)) return;
    const tip = this.deformed(new Vector3(...(step.contact_m as number[])), step);
    const direction = force.clone().normalize();
    const length = this.size * (0.08 + 0.3 * (strength / this.largestForce));
    const thick = this.size * 0.011;
    const material = new MeshBasicMaterial({ color: arrowColour });
    const towards = new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), direction);
    const head = new Mesh(new ConeGeometry(thick * 2.6, thick * 6, 20), material);
    head.quaternion.copy(towards);
    head.position.copy(tip).addScaledVector(direction, -thick * 3);
    const shaft = new Mesh(new CylinderGeometry(thick, thick, length, 16), material);
    shaft.quaternion.copy(towards);
    shaft.position.copy(tip).addScaledVector(direction, -thick * 6 - length / 2);
    this.push.add(head, shaft);
    const radius = step.tool_radius_m ?? 0;
    if (radius > 0) this.push.add(new Mesh(this.patchRim(step, direction, radius, thick * 0.4), material));
  }

  /** The rim of the touched patch, draped over the deformed surface. */
  private patchRim(step: Step, direction: Vector3, radius: number, thick: number): TubeGeometry {
    const centre = new Vector3(...(step.contact_m as number[]));
    const turn = new Quaternion().setFromUnitVectors(new Vector3(0, 0, 1), direction);
    const rim: Vector3[] = [];
    for (let k = 0; k < 48; ++k) {
      const angle = (2 * Math.PI * k) / 48;
      const at = new Vector3(Math.cos(angle), Math.sin(angle), 0).multiplyScalar(radius).applyQuaternion(turn).add(centre);
      rim.push(this.deformed(at, step).addScaledVector(direction, -thick));
    }
    return new TubeGeometry(new CatmullRomCurve3(rim, true), 96, thick, 6, true);
  }

  /** Where a point of the rest surface has gone: with its nearest vertex. */
  private deformed(point: Vector3, step: Step): Vector3 {
    if (!step.surface) return point;
    let best = -1;
    let distance = Infinity;
    for (let i = 0; i < this.report.rest.length; i += 3) {
      const d = (this.report.rest[i] - point.x) ** 2 + (this.report.rest[i + 1] - point.y) ** 2 + (this.report.rest[i + 2] - point.z) ** 2;
      if (d < distance) [best, distance] = [i, d];
    }
    if (best < 0) return point;
    const moved = [0, 1, 2].map((k) => step.surface![best + k] - this.report.rest[best + k]);
    return point.clone().add(new Vector3(...moved));
  }

  draw(): void {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame((now) => {
      this.pending = false;
      this.keepUp(now);
      this.lamp.position.copy(this.camera.position).addScaledVector(this.camera.up, this.size);
      this.renderer.render(this.scene, this.camera);
      this.canvas.dataset.frames = String(++this.frames);
    });
  }

  /** While the picture moves too slowly it is drawn with fewer pixels and points; once it rests, in full. */
  private keepUp(now: number): void {
    const gap = (now - this.lastFrame) / 1000;
    this.lastFrame = now;
    if (gap < 0.5) this.slowness = 0.7 * this.slowness + 0.3 * gap;
    if (!this.coarse && this.slowness > 0.03) this.coarsen(true);
    window.clearTimeout(this.settle);
    if (this.coarse) {
      this.settle = window.setTimeout(() => {
        this.coarsen(false);
        this.slowness = 0;
        this.lastFrame = 0;
        this.draw();
      }, 300);
    }
  }

  private coarsen(coarse: boolean): void {
    this.coarse = coarse;
    const ratio = Math.min(window.devicePixelRatio, 2);
    this.renderer.setPixelRatio(coarse ? ratio * 0.5 : ratio);
    const points = this.cloud.geometry.getAttribute("position")?.count ?? 0;
    this.cloud.geometry.setDrawRange(0, coarse ? Math.min(points, 3000) : points);
  }
}

function linear(byte: number): number {
  const c = byte / 255;
  return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
}

function replace(points: Points, positions: number[], colours?: number[]): void {
  points.geometry.dispose();
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(positions), 3));
  if (colours) geometry.setAttribute("color", new BufferAttribute(new Float32Array(colours), 3));
  points.geometry = geometry;
}

/** Each edge once, on the shared positions. */
function edgesOf(report: Report): BufferGeometry {
  const seen = new Set<number>();
  const index: number[] = [];
  const n = report.rest.length / 3;
  for (let t = 0; t < report.triangles.length; t += 3) {
    for (let k = 0; k < 3; ++k) {
      const [a, b] = [report.triangles[t + k], report.triangles[t + ((k + 1) % 3)]];
      const key = Math.min(a, b) * n + Math.max(a, b);
      if (seen.has(key)) continue;
      seen.add(key);
      index.push(a, b);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setIndex(index);
  return geometry;
}

function boundsOf(arrays: (Float32Array | null)[]): { centre: Vector3; size: number } {
  const low = new Vector3(Infinity, Infinity, Infinity);
  const high = new Vector3(-Infinity, -Infinity, -Infinity);
  for (const array of arrays) {
    for (let i = 0; array && i < array.length; i += 3) {
      const p = new Vector3(array[i], array[i + 1], array[i + 2]);
      low.min(p);
      high.max(p);
    }
  }
  if (low.x > high.x) return { centre: new Vector3(), size: 1 };
  return { centre: low.clone().add(high).multiplyScalar(0.5), size: Math.max(high.clone().sub(low).length() / 1.6, 1e-6) };
}
