// What MuJoCo 3 makes of a model: numbers of the compiled model, one array a line, and random states with what
// mj_inverse says of them. For tests/test_today.c, which compares.
//
//     npm install @mujoco/mujoco@3.14   (anywhere)
//     CAVORT_MUJOCO_JS=/path/to/node_modules/@mujoco/mujoco/mujoco.js node tests/peer_mujoco3.mjs FILE [STATES]
//
// Files beside the model and below are handed to it. Of a folder all its models, each by itself and after a line with its
// name. States: joints over their ranges and beyond, or within 1.5 rad or
// 0.3 m; friction cones elliptic.
import fs from 'fs';
import path from 'path';

const [, , given, states = '0'] = process.argv;
const load = (await import(process.env.CAVORT_MUJOCO_JS ?? '@mujoco/mujoco')).default;
const mujoco = await load({print: () => {}, printErr: () => {}});
const print = (name, values) => console.log(name + ' ' + Array.from(values, Number).join(' '));
let seed = 1;
const uniform = () => {
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return seed / 2147483648 - 1;
};

const beside = (root) => {
  const vfs = new mujoco.MjVFS();
  const add = (folder) => {
    for (const entry of fs.readdirSync(folder, {withFileTypes: true})) {
      const at = path.join(folder, entry.name);
      if (entry.isDirectory()) add(at);
      else vfs.addBuffer(path.relative(root, at), fs.readFileSync(at));
    }
  };
  add(root);
  return vfs;
};

// 0: refused, which is said
const tell = (file, vfs) => {
  let model;
  try {
    const text = fs.readFileSync(file, 'utf8');
    model = vfs ? mujoco.MjModel.from_xml_string(text, vfs) : mujoco.MjModel.from_xml_string(text);
  } catch (error) {
    console.log('error ' + String(error.message ?? error).replace(/\s+/g, ' '));
    return 0;
  }
  for (const name of ['nq', 'nv', 'nbody', 'njnt', 'ngeom', 'nu', 'ntendon', 'neq']) print(name, [model[name]]);
  for (const name of ['body_mass', 'body_inertia', 'jnt_stiffness', 'jnt_range', 'dof_damping', 'dof_M0', 'geom_size',
                      'actuator_gainprm', 'actuator_biasprm', 'actuator_ctrlrange', 'actuator_actrange',
                      'actuator_forcerange', 'tendon_lengthspring', 'hfield_data'])
    print(name, model[name]);
  model.opt.cone = 1;
  const data = new mujoco.MjData(model);
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
  }
  console.log('end');
  data.delete();
  model.delete();
  return 1;
};

if (fs.statSync(given).isDirectory()) {
  for (const name of fs.readdirSync(given).filter((n) => n.endsWith('.xml')).sort()) {
    console.log('file ' + name);
    tell(path.join(given, name));
  }
} else process.exitCode = tell(given, beside(path.dirname(given))) ? 0 : 1;
