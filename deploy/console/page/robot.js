// The robot in three dimensions: encoders solid, the operator's target as an outline, torque from outside as colour.
import {
  AmbientLight, BoxGeometry, CapsuleGeometry, CircleGeometry, Color, CylinderGeometry, DirectionalLight, GridHelper,
  BackSide, Group, HemisphereLight, LineBasicMaterial, LineSegments, EdgesGeometry, Mesh, MeshBasicMaterial, MeshLambertMaterial,
  OrbitControls, PerspectiveCamera, Quaternion, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from "/vendor/three.js";
import { jointsOfLinks, placeLinks } from "./kinematics.js";
import { push } from "./state.js";
import { tubes } from "./ahead.js";

const FULL_NM = 20; // the torque from outside at which a link is wholly red, where the robot tells no threshold
const NOTHING = 0.25; // what moving itself makes: this share of it has no colour
const SLOWEST_MS = 250;
const OUTLINE_M = 0.012;
const CALM = new Color("#c9d3dc");
const NOTICED = new Color("#f0e442");
const PUSHED = new Color("#d55e00");
const UNKNOWN = new Color("#77818b"); // the encoder is not valid
const UP = new Vector3(0, 1, 0);

const vector = (p) => new Vector3(...p);

/** A mesh between two points with round ends. */
function bar({ from_m, to_m, radius_m }, material, more_m = 0) {
  const [from, to] = [vector(from_m), vector(to_m)];
  const along = to.clone().sub(from);
  const mesh = new Mesh(new CapsuleGeometry(radius_m + more_m, along.length(), 5, 12), material);
  mesh.position.copy(from).addScaledVector(along, 0.5);
  if (along.length() > 0) mesh.quaternion.setFromUnitVectors(UP, along.normalize());
  return mesh;
}

/** A body's links, each a group of bars, placed by joint positions. */
class Figure {
  constructor(links, materialOf, more_m = 0) {
    this.links = links;
    this.whole = new Group();
    this.groups = links.map((link, i) => {
      const group = new Group();
      for (const capsule of link.capsules) group.add(bar(capsule, materialOf(i), more_m));
      this.whole.add(group);
      return group;
    });
  }

  place(positions) {
    const placed = placeLinks(this.links, positions);
    placed.forEach(({ origin, q }, i) => {
      this.groups[i].position.set(...origin);
      this.groups[i].quaternion.set(q[1], q[2], q[3], q[0]);
    });
    return placed;
  }

  /** Make each link thicker by so many m. */
  widen(more_m) {
    this.groups.forEach((group, i) => group.children.forEach((mesh, k) => {
      const radius = this.links[i].capsules[k].radius_m;
      const scale = (radius + more_m[i]) / radius;
      mesh.scale.set(scale, 1, scale);
    }));
  }
}

function zone(each) {
  const solid = new MeshBasicMaterial({ color: "#cc79a7", transparent: true, opacity: 0.22, depthWrite: false });
  if (each.shape === "box") {
    const geometry = new BoxGeometry(...each.size_m);
    const mesh = new Mesh(geometry, solid);
    mesh.add(new LineSegments(new EdgesGeometry(geometry), new LineBasicMaterial({ color: "#cc79a7" })));
    mesh.position.set(...each.center_m);
    mesh.rotation.z = ((each.yaw_deg ?? 0) * Math.PI) / 180;
    return mesh;
  }
  if (each.shape === "capsule") return bar(each, solid);
  if (each.shape === "sphere") {
    const mesh = new Mesh(new SphereGeometry(each.radius_m, 24, 16), solid);
    mesh.position.set(...each.center_m);
    return mesh;
  }
  if (each.shape === "half_space") {
    const mesh = new Mesh(new CircleGeometry(1, 48), solid);
    mesh.position.set(...each.point_m);
    mesh.quaternion.setFromUnitVectors(new Vector3(0, 0, 1), vector(each.free_side).normalize());
    return mesh;
  }
  return null;
}

/** Whether this computer draws by its processor alone: then edges stay rough, and the page stays quick. */
function software() {
  const context = document.createElement("canvas").getContext("webgl2");
  const names = context?.getExtension("WEBGL_debug_renderer_info");
  const name = names ? context.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

export class RobotView {
  /** Draws into `element`. Throws where the computer has no WebGL. */
  constructor(element, setup) {
    this.element = element;
    this.setup = setup;
    this.renderer = new WebGLRenderer({ antialias: !software(), preserveDrawingBuffer: true });
    this.renderer.setClearColor("#10161d");
    element.replaceChildren(this.renderer.domElement);
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(30, 1, 0.05, 30);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", () => this.draw());
    this.full = setup.joints.map((joint) => joint.contact_nm ?? FULL_NM);
    this.turners = jointsOfLinks(setup.links);
    this.build();
    this.look();
    new ResizeObserver(() => this.resize()).observe(element);
    this.resize();
  }

  build() {
    const { links, stand, zones } = this.setup;
    const sun = new DirectionalLight("#ffffff", 2.0);
    sun.position.set(3, 2, 5);
    this.scene.add(new AmbientLight("#ffffff", 0.5), new HemisphereLight("#ffffff", "#334455", 1.1), sun);
    const grid = new GridHelper(4, 16, "#3a4754", "#232d38");
    grid.rotation.x = Math.PI / 2;
    this.scene.add(grid);
    const dark = new MeshLambertMaterial({ color: "#46525e" });
    for (const post of stand ?? []) {
      const [from, to] = [vector(post.from_m), vector(post.to_m)];
      const along = to.clone().sub(from);
      const mesh = new Mesh(new CylinderGeometry(post.radius_m, post.radius_m, along.length(), 24), dark);
      mesh.position.copy(from).addScaledVector(along, 0.5);
      mesh.quaternion.setFromUnitVectors(UP, along.normalize());
      this.scene.add(mesh);
    }
    this.skins = links.map(() => new MeshLambertMaterial({ color: CALM }));
    this.solid = new Figure(links, (i) => this.skins[i]);
    // the far sides of bars that are a little thicker: a rim round the robot where it is at the target, else a body
    const outline = new MeshBasicMaterial({ color: "#56b4e9", side: BackSide, transparent: true, opacity: 0.6, depthWrite: false });
    this.ghost = new Figure(links, () => outline, OUTLINE_M);
    this.ghost.whole.visible = false;
    const mist = new MeshBasicMaterial({ color: "#00b386", transparent: true, opacity: 0.22, depthWrite: false });
    this.will = new Figure(links, () => mist);
    this.will.whole.visible = false;
    this.zones = new Group();
    for (const each of zones ?? []) {
      const mesh = zone(each);
      if (mesh) this.zones.add(mesh);
    }
    this.zones.visible = false;
    this.solid.place(this.setup.joints.map(() => 0));
    this.scene.add(this.solid.whole, this.will.whole, this.ghost.whole, this.zones);
  }

  /** From where all of the robot is seen, from ahead and its left. */
  look(further = 1) {
    const zero = this.setup.joints.map((joint) => Math.min(Math.max(0, joint.lower_rad), joint.upper_rad));
    const points = placeLinks(this.setup.links, zero).flatMap(({ origin, q }, i) =>
      this.setup.links[i].capsules.flatMap((c) =>
        [c.from_m, c.to_m].map((p) => vector(p).applyQuaternion(new Quaternion(q[1], q[2], q[3], q[0])).add(vector(origin)))));
    const low = new Vector3(Infinity, Infinity, Infinity);
    const high = low.clone().negate();
    for (const p of points) {
      low.min(p);
      high.max(p);
    }
    const middle = points.length ? low.clone().add(high).multiplyScalar(0.5) : new Vector3(0, 0, 1);
    // all of its height, with room for a raised head; wide as the panel is, its breadth fits too
    const height = points.length ? Math.max(0.3, high.z - low.z) + 0.25 : 1.5;
    const away = height / 2 / Math.tan((this.camera.fov * Math.PI) / 360);
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).add(new Vector3(0.88, 0.4, 0.18).normalize().multiplyScalar(away * further));
    this.controls.update();
    this.draw();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 1.5));
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  showZones(on) {
    this.zones.visible = on;
    this.look(on ? 1.5 : 1);
  }

  /** Draw the newest view at the next frame; where frames come slowly, leave time for the rest of the page. */
  show(view) {
    const waits = Boolean(this.next);
    this.next = view;
    if (!waits) requestAnimationFrame((now_ms) => this.frame(now_ms));
  }

  frame(now_ms) {
    const gap_ms = now_ms - (this.frame_ms ?? now_ms);
    if (gap_ms < Math.min(SLOWEST_MS, this.pause_ms ?? 0)) {
      requestAnimationFrame((later_ms) => this.frame(later_ms));
      return;
    }
    const view = this.next;
    this.next = null;
    this.frame_ms = now_ms;
    const before_ms = performance.now();
    this.pose(view);
    // by a software rasteriser the drawing goes on elsewhere: the next frame tells how long it took
    requestAnimationFrame(() => (this.pause_ms = 2 * (performance.now() - before_ms)));
  }

  /** Draw a view: a joint whose encoder is not valid stays where it was last seen, and is grey. */
  pose(view) {
    this.last ??= this.setup.joints.map(() => 0);
    this.last = this.last.map((before, j) => view.encoder[j] ?? before);
    this.solid.place(this.last);
    this.skins.forEach((skin, i) => {
      const joints = this.turners[i];
      const share = Math.max(0, (push(view, joints, this.full) ?? 0) - NOTHING) / (1 - NOTHING);
      if (joints.some((j) => view.encoder[j] === null)) skin.color.copy(UNKNOWN);
      else if (share < 0.5) skin.color.copy(CALM).lerp(NOTICED, share * 2);
      else skin.color.copy(NOTICED).lerp(PUSHED, share * 2 - 1);
    });
    const aimed = Boolean(view.target?.some((angle) => angle !== null));
    this.ghost.whole.visible = aimed;
    if (aimed) this.ghost.place(this.last.map((angle, j) => view.target[j] ?? angle));
    this.will.whole.visible = Boolean(view.ahead);
    if (view.ahead) {
      const placed = this.will.place(this.last.map((angle, j) => view.ahead.position[j] ?? angle));
      this.will.widen(tubes(this.setup.links, placed, view.ahead.tube));
    }
    this.draw();
  }

  draw() {
    this.renderer.render(this.scene, this.camera);
  }
}
