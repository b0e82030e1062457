// Plays the controls of a result's servos in MuJoCo 3, open loop: nothing but controls.csv, linear between knots, as a robot's own
// servos would get it. Prints how far the farthest centre of mass of a body is from the plan, at the worst knot and at the end.
//
//     npm install @mujoco/mujoco@3.14   (anywhere)
//     CAVORT_MUJOCO_JS=/path/to/node_modules/@mujoco/mujoco/mujoco.js node tests/replay_servo.mjs MODEL DIR...
import fs from 'fs';
import path from 'path';

const [, , file, ...folders] = process.argv;
const load = (await import(process.env.CAVORT_MUJOCO_JS ?? '@mujoco/mujoco')).default;
const mujoco = await load({print: () => {}, printErr: () => {}});
const table = (name) => {
  const [head, ...rows] = fs.readFileSync(name, 'utf8').trim().split('\n').map((line) => line.split(','));
  return {head, rows: rows.map((row) => row.map(Number))};
};
const columns = (t, start) => t.head.map((name, i) => [name, i]).filter(([name]) => name.startsWith(start)).map(([, i]) => i);

// motions may stand in a scene of their own: what their problem adds to the world is in the problem file
const scene = (folder) => {
  const added = /<scene>([\s\S]*?)<\/scene>/.exec(fs.readFileSync(path.join(folder, 'problem.xml'), 'utf8'));
  return fs.readFileSync(file, 'utf8').replace('</worldbody>', (added ? added[1] : '') + '</worldbody>');
};

for (const folder of folders) {
  const model = mujoco.MjModel.from_xml_string(scene(folder));
  const plan = table(path.join(folder, 'trajectory.csv')), controls = table(path.join(folder, 'controls.csv'));
  const q = columns(plan, 'qpos_'), v = columns(plan, 'qvel_'), c = columns(controls, 'ctrl_');
  const data = new mujoco.MjData(model), there = new mujoco.MjData(model), h = plan.rows[1][0] - plan.rows[0][0];
  const apart = (knot) => {
    there.qpos.set(q.map((i) => plan.rows[knot][i]));
    mujoco.mj_kinematics(model, there), mujoco.mj_comPos(model, there);
    let most = 0;
    for (let b = 1; b < model.nbody; b++)
      most = Math.max(most, Math.hypot(...[0, 1, 2].map((k) => data.xipos[3 * b + k] - there.xipos[3 * b + k])));
    return most;
  };
  for (const step of [0.001, 0.002]) {
    model.opt.timestep = step;
    mujoco.mj_resetData(model, data);
    data.qpos.set(q.map((i) => plan.rows[0][i])), data.qvel.set(v.map((i) => plan.rows[0][i]));
    const each = Math.round(h / step), last = plan.rows.length - 1;
    let worst = 0, end = 0;
    for (let t = 0; t < last; t++) {
      const a = controls.rows[Math.min(t, controls.rows.length - 1)], b = controls.rows[Math.min(t + 1, controls.rows.length - 1)];
      for (let i = 0; i < each; i++) {
        data.ctrl.set(c.map((k) => a[k] + (b[k] - a[k]) * i / each));
        mujoco.mj_step(model, data);
      }
      mujoco.mj_kinematics(model, data), mujoco.mj_comPos(model, data);
      end = apart(t + 1), worst = Math.max(worst, end);
    }
    console.log(`${path.basename(folder)}: ${1e3 * step} ms, worst ${(1e3 * worst).toFixed(1)} mm, end ${(1e3 * end).toFixed(1)} mm`);
  }
}
