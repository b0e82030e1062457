// What MuJoCo 3 makes of a model: numbers of the compiled model, one array a line, and random states with what
// mj_inverse says of them. For tests/test_today.c, which compares.
//
//     npm install @mujoco/mujoco@3.14   (anywhere)
//     CAVORT_MUJOCO_JS=/path/to/node_modules/@mujoco/mujoco/mujoco.js node tests/peer_mujoco3.mjs FILE [STATES]
//
// Files beside the model and below are handed to it. States: joints over their ranges and beyond, or within 1.5 rad or
// 0.3 m; friction cones elliptic. Each twice: as MuJoCo has it (state_u), and with connects and welds by the law that
// version 2.2.2 has too (state_settled): a reference of -b J v - k x alone, and the weight of translations in all rows
// of a weld. What 3.14 adds to that reference is -J'v: state_excess is the largest difference of the two, J' by
// central differences, relative to 1 + the added.
import fs from 'fs';
import path from 'path';

const [, , file, states = '0'] = process.argv;
const load = (await import(process.env.CAVORT_MUJOCO_JS ?? '@mujoco/mujoco')).default;
const mujoco = await load({print: () => {}, printErr: () => {}});
const vfs = new mujoco.MjVFS(), root = path.dirname(file);
const add = (folder) => {
  for (const entry of fs.readdirSync(folder, {withFileTypes: true})) {
    const at = path.join(folder, entry.name);
    if (entry.isDirectory()) add(at);
    else vfs.addBuffer(path.relative(root, at), fs.readFileSync(at));
  }
};
add(root);
let model;
try {
  model = mujoco.MjModel.from_xml_string(fs.readFileSync(file, 'utf8'), vfs);
} catch (error) {
  console.log('error ' + String(error.message ?? error).replace(/\s+/g, ' '));
  process.exit(1);
}
const print = (name, values) => console.log(name + ' ' + Array.from(values, Number).join(' '));
for (const name of ['nq', 'nv', 'nbody', 'njnt', 'ngeom', 'nu', 'ntendon', 'neq']) print(name, [model[name]]);
for (const name of ['body_mass', 'body_inertia', 'jnt_stiffness', 'jnt_range', 'dof_damping', 'dof_M0', 'geom_size',
                    'actuator_gainprm', 'actuator_biasprm', 'actuator_ctrlrange', 'actuator_actrange',
                    'actuator_forcerange', 'tendon_lengthspring', 'hfield_data'])
  print(name, model[name]);

let seed = 1;
const uniform = () => {
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return seed / 2147483648 - 1;
};
model.opt.cone = 1;
model.opt.jacobian = 0; // dense
const data = new mujoco.MjData(model), beside = new mujoco.MjData(model), nv = model.nv;
// rows of connects and welds
const ours = (d) => Array.from({length: d.nefc}, (_, i) => i)
                      .filter((i) => d.efc_type[i] == 0 && model.eq_type[d.efc_id[i]] < 2);
const row = (J, i) => Array.from(J.slice(i * nv, (i + 1) * nv));
const times = (a, b) => a.reduce((sum, x, k) => sum + x * b[k], 0);
// J v at q + step v
const rates = (step) => {
  beside.qpos.set(data.qpos);
  beside.qvel.set(data.qvel);
  mujoco.mj_integratePos(model, beside.qpos, data.qvel, step);
  mujoco.mj_fwdPosition(model, beside);
  const J = beside.efc_J.slice();
  return ours(beside).map((i) => times(row(J, i), data.qvel));
};
const settle = () => {
  const rows = ours(data), u = Array.from(data.qfrc_inverse), J = data.efc_J.slice();
  if (rows.length == 0) return [u, 0];
  const ahead = rates(1e-5), behind = rates(-1e-5);
  let excess = 0;
  rows.forEach((i, at) => {
    const kbip = data.efc_KBIP.slice(4 * i, 4 * i + 4), Ji = row(J, i), id = data.efc_id[i];
    const reference = -kbip[1] * data.efc_vel[i] - kbip[0] * kbip[2] * (data.efc_pos[i] - data.efc_margin[i]);
    const added = data.efc_aref[i] - reference, rate = (ahead[at] - behind[at]) / 2e-5;
    excess = Math.max(excess, Math.abs(added + rate) / (1 + Math.abs(added)));
    // the first three rows of a constraint are its translations
    const D = data.efc_D[rows.find((k) => data.efc_id[k] == id)];
    for (let k = 0; k < nv; k++)
      u[k] += Ji[k] * (data.efc_force[i] - D * (reference - times(Ji, data.qacc)));
  });
  return [u, excess];
};
for (let k = 0; k < +states; k++) {
  for (let j = 0; j < model.njnt; j++) {
    const at = model.jnt_qposadr[j], type = model.jnt_type[j], low = model.jnt_range[2 * j], high = model.jnt_range[2 * j + 1];
    if (type < 2) {
      const quat = [uniform(), uniform(), uniform(), uniform()], norm = Math.hypot(...quat), start = at + (type ? 0 : 3);
      for (let i = 0; i < 4; i++) data.qpos[start + i] = quat[i] / norm;
      for (let i = at; i < start; i++) data.qpos[i] = model.qpos0[i] + 0.3 * uniform();
    } else if (low < high) data.qpos[at] = (low + high) / 2 + 0.6 * (high - low) * uniform();
    else data.qpos[at] = (type == 3 ? 1.5 : 0.3) * uniform();
  }
  for (let i = 0; i < model.nv; i++) {
    data.qvel[i] = 2 * uniform();
    data.qacc[i] = 20 * uniform();
  }
  mujoco.mj_inverse(model, data);
  print('state_q', data.qpos);
  print('state_v', data.qvel);
  print('state_a', data.qacc);
  print('state_u', data.qfrc_inverse);
  const [settled, excess] = settle();
  print('state_settled', settled);
  print('state_excess', [excess]);
}
