// The solver that closes loops and drags links to points: least squares over the coordinates of a mode, by damped Newton steps
// (Levenberg and Marquardt; see Nocedal and Wright, Numerical Optimization, 2006, section 10.3).

import { Matrix4, Vector3 } from "three";
import type { Loop, Robot } from "./data";
import { type Coordinates, type Couplings, matrixOf, move, rotationVector, type Tree } from "./kinematics";

export interface Goal { body: number; point: Vector3; target: Vector3 }

export interface Answer { q: Coordinates; base: Matrix4; open: number }

/** A coordinate that the solver changes, with its range and the scale of a step. */
interface Unknown { path: string; lower: number; upper: number; scale: number }

/** The weight of loops relative to a goal. */
const WEIGHT = 1e2;

/** Closes the loops of a mode. */
export class Solver {
  private readonly loops: { loop: Loop; X_PA: Matrix4; X_CB: Matrix4 }[];
  private readonly placed: Matrix4[];
  private readonly turns: Map<string, boolean>;
  /** The length [m] that a radian counts as: the displacement at half the size of the robot. */
  private readonly radian: number;

  /** The tolerances depend on the `size` [m] of the robot. */
  constructor(robot: Robot, private readonly tree: Tree, private readonly couplings: Couplings, private readonly size: number) {
    this.turns = new Map(robot.joints.map((joint) => [joint.path, joint.turns]));
    this.loops = tree.mode.loops.map((loop) => ({ loop, X_PA: matrixOf(loop.X_PA), X_CB: matrixOf(loop.X_CB) }));
    this.placed = tree.fresh();
    this.radian = size / 2;
  }

  /** Whether the mode has loops or holds. */
  get closes(): boolean {
    return this.loops.length > 0;
  }

  /** Whether the gap of the worst loop is negligible. */
  closed({ open }: Answer): boolean {
    return open <= 1e-6 * this.size;
  }

  /** Whether the base is an unknown: a free base follows the held links. */
  private get carries(): boolean {
    return this.tree.mode.base === "free" && this.loops.some(({ loop }) => loop.hold);
  }

  /** The gap [m] of the worst loop. */
  openness(q: Coordinates, base: Matrix4): number {
    return this.residuals(q, base, null).reduce((worst, one) => Math.max(worst, Math.abs(one)), 0);
  }

  /**
   * Finds coordinates near `q` that close the loops, without changing `fixed` ones, and bring a point of a body as near to its target as possible.
   * `open` is the gap [m] of the worst loop.
   */
  solve(q: Coordinates, base: Matrix4, fixed: ReadonlySet<string>, goal: Goal | null = null, rounds = 40): Answer {
    const unknowns = this.unknowns(fixed);
    let here: Answer = { q: { ...q }, base: base.clone(), open: 0 };
    let residual = this.residuals(here.q, here.base, goal);
    let error = squares(residual), damping = goal === null ? 1e-6 : 1e-4;
    const enough = (1e-11 * this.size) ** 2;
    for (let round = 0; round < rounds && error > enough; round += 1) {
      const step = this.step(unknowns, here, residual, goal, damping);
      if (step === null) break;
      const tried = this.moved(unknowns, here, step);
      const after = this.residuals(tried.q, tried.base, goal);
      const left = squares(after);
      if (left < error) {
        const gained = error - left;
        [here, residual, error] = [tried, after, left];
        damping = Math.max(damping / 10, 1e-12);
        if (gained < 1e-12 * error) break;
      } else if ((damping *= 10) > 1e6) break;
    }
    return { ...here, open: this.openness(here.q, here.base) };
  }

  private unknowns(fixed: ReadonlySet<string>): Unknown[] {
    const kept = new Set([...fixed].map((path) => this.couplings.leader(path).path));
    const all = [...this.tree.bodies.flatMap((body) => body.joints), ...this.loops.flatMap(({ loop }) => loop.joints)];
    const paths = new Set(all.map(({ path }) => this.couplings.leader(path).path));
    return [...paths].filter((path) => !kept.has(path)).map((path) => {
      const [lower, upper] = this.couplings.range(path);
      return { path, lower, upper, scale: this.turns.get(path) ? 1 : this.radian };
    });
  }

  private residuals(q: Coordinates, base: Matrix4, goal: Goal | null): number[] {
    const weight = goal === null ? 1 : WEIGHT;
    const placed = this.tree.place(q, base, this.placed);
    const residual: number[] = [];
    for (const { loop, X_PA, X_CB } of this.loops) {
      const a = loop.parent === null ? X_PA.clone() : new Matrix4().multiplyMatrices(placed[loop.parent], X_PA);
      move(a, loop.joints, loop.at_once, q);
      const b = new Matrix4().multiplyMatrices(placed[loop.child], X_CB);
      const apart = a.invert().multiply(b);
      const [x, y, z] = [apart.elements[12], apart.elements[13], apart.elements[14]];
      residual.push(weight * x, weight * y, weight * z);
      if (!loop.turns) residual.push(...rotationVector(apart).map((angle) => weight * this.radian * angle));
    }
    if (goal !== null) {
      const at = goal.point.clone().applyMatrix4(placed[goal.body]);
      residual.push(at.x - goal.target.x, at.y - goal.target.y, at.z - goal.target.z);
    }
    return residual;
  }

  /** A damped step; coordinates that would leave their range are held at their limit. */
  private step(unknowns: Unknown[], here: Answer, residual: number[], goal: Goal | null, damping: number): number[] | null {
    const columns = this.jacobian(unknowns, here, residual, goal);
    const active = columns.map((_, column) => column);
    for (;;) {
      const part = damped(active.map((column) => columns[column]), residual, damping);
      if (part === null) return null;
      const step = columns.map(() => 0);
      active.forEach((column, k) => { step[column] = part[k]; });
      const stopped = active.filter((column) => {
        const own = unknowns[column] as Unknown | undefined; // undefined for columns of the base
        return own !== undefined && ((here.q[own.path] <= own.lower && step[column] < 0) || (here.q[own.path] >= own.upper && step[column] > 0));
      });
      if (stopped.length === 0) return step;
      for (const column of stopped) active.splice(active.indexOf(column), 1);
    }
  }

  /** The Jacobian by finite differences; its columns are the unknowns, then six for a moving base. */
  private jacobian(unknowns: Unknown[], here: Answer, residual: number[], goal: Goal | null): number[][] {
    const size = 1e-7;
    const count = unknowns.length + (this.carries ? 6 : 0);
    return Array.from({ length: count }, (_, column) => {
      const step = new Array<number>(count).fill(0);
      // backwards at an upper limit, to which `settle` would clamp it
      const own = unknowns[column] as Unknown | undefined;
      const back = own !== undefined && here.q[own.path] + size * own.scale > own.upper ? -size : size;
      step[column] = back;
      const tried = this.moved(unknowns, here, step);
      const after = this.residuals(tried.q, tried.base, goal);
      return after.map((value, row) => (value - residual[row]) / back);
    });
  }

  private moved(unknowns: Unknown[], here: Answer, step: number[]): Answer {
    const q = { ...here.q };
    unknowns.forEach(({ path, scale }, index) => { q[path] += step[index] * scale; });
    this.couplings.settle(q);
    if (!this.carries) return { q, base: here.base, open: 0 };
    const [x, y, z, a, b, c] = step.slice(unknowns.length);
    const spin = new Vector3(a, b, c);
    const angle = spin.length();
    const base = here.base.clone();
    if (angle > 0) base.premultiply(new Matrix4().makeRotationAxis(spin.divideScalar(angle), angle));
    const at = new Vector3(x, y, z).multiplyScalar(this.radian).add(new Vector3().setFromMatrixPosition(here.base));
    base.setPosition(at);
    return { q, base, open: 0 };
  }
}

const squares = (values: number[]): number => values.reduce((sum, value) => sum + value * value, 0);

/** The step d with (J'J + damping diag) d = -J'r, by Cholesky's method; null if the matrix is singular. */
function damped(columns: number[][], residual: number[], damping: number): number[] | null {
  const n = columns.length;
  if (n === 0) return null;
  const A = columns.map((one) => columns.map((other) => one.reduce((sum, value, row) => sum + value * other[row], 0)));
  const scale = Math.max(...A.map((row, k) => row[k]), 1e-300);
  const b = columns.map((one) => -one.reduce((sum, value, row) => sum + value * residual[row], 0));
  for (let k = 0; k < n; k += 1) A[k][k] += damping * scale;
  for (let i = 0; i < n; i += 1) {
    for (let j = 0; j <= i; j += 1) {
      let sum = A[i][j];
      for (let k = 0; k < j; k += 1) sum -= A[i][k] * A[j][k];
      if (i === j) {
        if (sum <= 0) return null;
        A[i][i] = Math.sqrt(sum);
      } else A[i][j] = sum / A[j][j];
    }
  }
  for (let i = 0; i < n; i += 1) {
    for (let k = 0; k < i; k += 1) b[i] -= A[i][k] * b[k];
    b[i] /= A[i][i];
  }
  for (let i = n - 1; i >= 0; i -= 1) {
    for (let k = i + 1; k < n; k += 1) b[i] -= A[k][i] * b[k];
    b[i] /= A[i][i];
  }
  return b;
}
