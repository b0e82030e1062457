#!/bin/sh
# Files that cavort export writes, read by others: npz, csv, glb and bvh by Python alone, which puts links where the npz has
# them by the nodes and channels of each file; numpy, glTF's validator, MuJoCo 3, chromium and ffmpeg where they are there.
# Usage: test_exchange.sh CAVORT SOURCE_ROOT
#   CAVORT_GLTF_VALIDATOR  node_modules/gltf-validator/index.js (npm install gltf-validator)
#   CAVORT_MUJOCO_JS       node_modules/@mujoco/mujoco/mujoco.js (npm install @mujoco/mujoco@3.14)
set -u
cavort=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
root=$(cd "$2" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failed=0
fail() { failed=$((failed + 1)); echo "failed: $*"; }

# status 1: nothing holds its base, so it is not certified
cp "$root/tests/exchange.xml" "$root/tests/exchange_model.xml" .
"$cavort" solve exchange.xml -o result --threads 1 --strategies 1 --quiet
[ $? -le 1 ] || fail "the problem is not solved"
for format in keyframes npz glb bvh csv; do
  "$cavort" export result --to $format --rate 60 >out 2>err || { fail "$format"; cat err; }
  grep -q "19 samples, 0.0166667 s apart" out || { fail "$format says its samples"; cat out; }
done
"$cavort" export result --to bvhh 2>err && fail "a wrong format passes"
grep -q "did you mean 'bvh'" err || fail "a wrong format is told"
"$cavort" export result 2>err && fail "no format passes"
"$cavort" export result --to npz -o /nowhere/at/all.npz 2>err && fail "a folder that is not there passes"
"$cavort" export result --to csv --rate 0 2>err && fail "rate 0 passes"
"$cavort" export result --to npz --rate 0.1 2>err && fail "a rate that leaves one sample passes"
PATH=/nowhere "$cavort" export result --to mp4 2>err && fail "a video without chromium passes"
grep -q "apt-get install chromium" err || fail "the missing package is told"

cat >check.py <<'PYTHON'
import ast, csv, json, math, struct, sys, zipfile
failed = 0
def check(what, holds):
    global failed
    if not holds: failed += 1; print('failed:', what)

# npz by its definition: a zip (whose sums zipfile checks) of .npy
arrays = {}
with zipfile.ZipFile('result/motion.npz') as archive:
    check('sums of the zip', archive.testzip() is None)
    for name in archive.namelist():
        data = archive.read(name)
        check('npy', data[:8] == b'\x93NUMPY\x01\x00')
        length = struct.unpack('<H', data[8:10])[0]
        check('aligned', (10 + length) % 64 == 0)
        head = ast.literal_eval(data[10:10 + length].decode())
        count = math.prod(head['shape'])
        kind, body = head['descr'], data[10 + length:]
        if kind[1] == 'U':
            width = int(kind[2:])
            values = [body[4 * width * i:4 * width * (i + 1)].decode('utf-32-le').rstrip('\0') for i in range(count)]
        else:
            values = struct.unpack('<%d%s' % (count, {'<f8': 'd', '<i4': 'i'}[kind]), body)
        arrays[name[:-4]] = (head['shape'], values)
n, nq, nv, nu, nbody = 19, 16, 14, 5, 6
for name, shape in {'time': (n,), 'qpos': (n, nq), 'qvel': (n, nv), 'ctrl': (n, nu), 'actuator_force': (n, nu),
                    'qfrc': (n, nv), 'xpos': (n, nbody, 3), 'xquat': (n, nbody, 4), 'contact_start': (n + 1,),
                    'joint_names': (7,), 'joint_qposadr': (7,), 'body_names': (nbody,)}.items():
    check('%s has shape %s, not %s' % (name, shape, arrays[name][0]), arrays[name][0] == shape)
check('names of joints', arrays['joint_names'][1] == ['root', 'shoulder', 'elbow', 'slide', 'yaw', 'pitch', 'swing'])
check('contacts add up', arrays['contact_start'][1][-1] == arrays['contact_dist'][0][0])
bodies = arrays['body_names'][1]
check('names of bodies', bodies == ['world', 'base', 'upper', 'lower', 'slider', 'second tree'])
def truth(i, body):
    at = i * nbody + bodies.index(body)
    return arrays['xpos'][1][3 * at:3 * at + 3], arrays['xquat'][1][4 * at:4 * at + 4]

# csv: the same numbers
rows = list(csv.reader(open('result/motion.csv')))
check('columns', rows[0][:4] == ['time', 'qpos_root_0', 'qpos_root_1', 'qpos_root_2'] and 'ctrl_swing' in rows[0])
values = [[float(x) for x in row] for row in rows[1:]]
check('rows', len(values) == n and tuple(values[7][1:1 + nq]) == arrays['qpos'][1][7 * nq:8 * nq])
at = rows[0].index('ctrl_elbow')
check('controls', tuple(values[7][at:at + nu]) == arrays['ctrl'][1][7 * nu:8 * nu])

def mul(a, b): return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
def apply(a, x): return [sum(a[i][k] * x[k] for k in range(3)) for i in range(3)]
def matrix(w, x, y, z):
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
def y_up(p): return [p[0], p[2], -p[1]]
def apart(a, b): return max(abs(x - y) for x, y in zip(a, b))

# glb: placed by its nodes and its animation
data = open('result/motion.glb', 'rb').read()
magic, version, total, length, kind = struct.unpack('<5I', data[:20])
check('head of the glb', (magic, version, total, kind) == (0x46546c67, 2, len(data), 0x4e4f534a))
doc, binary = json.loads(data[20:20 + length]), data[28 + length:]
def accessor(k):
    a = doc['accessors'][k]
    view, width = doc['bufferViews'][a['bufferView']], {'SCALAR': 1, 'VEC3': 3, 'VEC4': 4}[a['type']]
    x = struct.unpack_from('<%d%s' % (a['count'] * width, {5126: 'f', 5125: 'I'}[a['componentType']]), binary, view['byteOffset'])
    return [x[i * width:(i + 1) * width] for i in range(a['count'])]
animation, moves = doc['animations'][0], {}
for channel in animation['channels']:
    sampler = animation['samplers'][channel['sampler']]
    times = [t[0] for t in accessor(sampler['input'])]
    check('times of the animation', apart(times, arrays['time'][1]) < 1e-6)
    moves[channel['target']['node'], channel['target']['path']] = accessor(sampler['output'])
worst, seen = 0, 0
def place(node, i, pos, rotation):
    global worst, seen
    it = doc['nodes'][node]
    t = moves[node, 'translation'][i] if (node, 'translation') in moves else it.get('translation', [0, 0, 0])
    x, y, z, w = moves[node, 'rotation'][i] if (node, 'rotation') in moves else it.get('rotation', [0, 0, 0, 1])
    pos = [a + b for a, b in zip(pos, apply(rotation, t))]
    rotation = mul(rotation, matrix(w, x, y, z))
    if it['name'] in bodies and 'mesh' not in it:
        true_pos, true_quat = truth(i, it['name'])
        true = [y_up(column) for column in zip(*matrix(*true_quat))]
        worst = max(worst, apart(pos, y_up(true_pos)), max(apart(a, b) for a, b in zip(zip(*rotation), true)))
        seen += 1
    for child in it.get('children', []): place(child, i, pos, rotation)
for i in range(n): place(doc['scenes'][0]['nodes'][0], i, [0, 0, 0], [[1, 0, 0], [0, 1, 0], [0, 0, 1]])
check('links of the glb, off by %g' % worst, worst < 1e-6 and seen == n * nbody)  # single precision: 4e-7 seen
for mesh in doc['meshes']:
    part = mesh['primitives'][0]
    vertices, normals, index = (accessor(k) for k in (part['attributes']['POSITION'], part['attributes']['NORMAL'], part['indices']))
    index = [i[0] for i in index]
    check('corners exist', max(index) < len(vertices) and len(index) % 3 == 0)
    # triangles look where their normals do
    for a, b, c in zip(index[::3], index[1::3], index[2::3]):
        p, q, r = vertices[a], vertices[b], vertices[c]
        u, v = [y - x for x, y in zip(p, q)], [y - x for x, y in zip(p, r)]
        cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        if sum(x * y for x, y in zip(cross, normals[a])) <= 0: check('a triangle looks outside', False); break

# bvh: read by its grammar, played by offsets and channels
words, joints = open('result/motion.bvh').read().split(), []
def joint(at, parent):
    it = {'name': words[at + 1], 'parent': parent, 'channels': []}
    joints.append(it)
    me, at = len(joints) - 1, at + 3
    while words[at] != '}':
        if words[at] == 'OFFSET': it['offset'], at = [float(x) for x in words[at + 1:at + 4]], at + 4
        elif words[at] == 'CHANNELS': k = int(words[at + 1]); it['channels'], at = words[at + 2:at + 2 + k], at + 2 + k
        elif words[at] == 'JOINT': at = joint(at, me)
        else: at += 8  # End Site { OFFSET x y z }
    return at + 1
at = joint(1, None)
check('frames of the bvh', words[at] == 'MOTION' and int(words[at + 2]) == n and abs(float(words[at + 5]) - 1 / 60) < 1e-8)
numbers, worst, seen = iter([float(x) for x in words[at + 6:]]), 0, 0
for i in range(n):
    for it in joints:
        pos, rotation = list(it['offset']), [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
        for name in it['channels']:
            x = next(numbers)
            if 'position' in name: pos['XYZ'.index(name[0])] = x; continue
            a = math.radians(x) / 2
            rotation = mul(rotation, matrix(math.cos(a), *[math.sin(a) if axis == name[0] else 0 for axis in 'XYZ']))
        if it['parent'] is not None:
            above = joints[it['parent']]
            pos = [a + b for a, b in zip(above['pos'], apply(above['rotation'], pos))]
            rotation = mul(above['rotation'], rotation)
        it['pos'], it['rotation'] = pos, rotation
        body = it['name'].replace('_', ' ')
        if body not in bodies: continue
        # where its hinges and balls turn about
        anchor = {'upper': [0.01, 0.02, 0.03], 'lower': [0, 0, 0.02], 'slider': [0, 0.05, 0]}.get(body, [0, 0, 0])
        true_pos, true_quat = truth(i, body)
        true = [a + b for a, b in zip(true_pos, apply(matrix(*true_quat), anchor))]
        worst, seen = max(worst, apart(pos, y_up(true))), seen + 1
check('joints of the bvh, off by %g' % worst, worst < 1e-6 and seen == n * nbody)  # nine digits: 3e-9 seen
check('all of the bvh is read', next(numbers, None) is None)
try:
    import numpy
    loaded = numpy.load('result/motion.npz')
    for name, (shape, values) in arrays.items():
        check('numpy reads ' + name, loaded[name].shape == shape and loaded[name].ravel().tolist() == list(values))
except ImportError: print('left out: numpy is not here')
sys.exit(failed > 0)
PYTHON
python=python3
/usr/bin/python3 -c 'import numpy' 2>/dev/null && python=/usr/bin/python3
$python check.py || failed=$((failed + 1))

if [ -n "${CAVORT_GLTF_VALIDATOR:-}" ]; then
  cat >validate.mjs <<'NODE'
import fs from 'fs';
const validator = (await import(process.env.CAVORT_GLTF_VALIDATOR)).default;
const {issues} = await validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])));
console.log(`glTF's validator: ${issues.numErrors} errors, ${issues.numWarnings} warnings, ${issues.numInfos} infos`);
for (const it of issues.messages.slice(0, 5)) console.log(`  ${it.code} ${it.pointer}: ${it.message}`);
process.exit(issues.numErrors + issues.numWarnings > 0 ? 1 : 0);
NODE
  node validate.mjs result/motion.glb || fail "the glb is not valid"
else
  echo "left out: glTF's validator (CAVORT_GLTF_VALIDATOR)"
fi

# MuJoCo 3 reads files from a folder of its own: model and keyframes side by side
if [ -n "${CAVORT_MUJOCO_JS:-}" ]; then
  "$cavort" export result --to keyframes -o keyframes.xml -q || fail "keyframes beside the model"
  "$cavort" export result --to csv -o knots.csv -q || fail "a table of the knots"
  "$cavort" export result --to npz -o knots.npz -q || fail "arrays of the knots"
  cat >play.mjs <<'NODE'
import fs from 'fs';
const load = (await import(process.env.CAVORT_MUJOCO_JS)).default;
const mujoco = await load({print: () => {}, printErr: () => {}});
const vfs = new mujoco.MjVFS();
vfs.addBuffer('exchange_model.xml', fs.readFileSync('exchange_model.xml'));
const model = mujoco.MjModel.from_xml_string(fs.readFileSync('keyframes.xml', 'utf8'), vfs);
const data = new mujoco.MjData(model);
for (let k = 0; k < model.nkey; k++) {
  mujoco.mj_resetDataKeyframe(model, data, k);
  mujoco.mj_forward(model, data);
  console.log(Array.from(data.xpos).slice(3).concat(Array.from(data.qpos)).join(' '));
}
NODE
  node play.mjs >played.txt || fail "MuJoCo 3 does not load the keyframes"
  python3 - <<'PYTHON' || fail "MuJoCo 3 places bodies elsewhere"
import struct, sys, zipfile
data = zipfile.ZipFile('knots.npz').read('xpos.npy')
x = struct.unpack('<%dd' % (13 * 6 * 3), data[-13 * 6 * 3 * 8:])
rows = [[float(v) for v in line.split()] for line in open('played.txt')]
worst = max(abs(a - b) for i, row in enumerate(rows) for a, b in zip(row[:15], x[18 * i + 3:18 * i + 18]))
print('MuJoCo 3: %d keyframes, bodies off by %.1e m at most' % (len(rows), worst))
sys.exit(not (len(rows) == 13 and worst < 1e-9))
PYTHON
else
  echo "left out: MuJoCo 3 (CAVORT_MUJOCO_JS)"
fi

if command -v chromium >/dev/null 2>&1 && command -v ffprobe >/dev/null 2>&1; then
  if "$cavort" export result --to mp4 --rate 20 >out 2>err; then
    frames=$(ffprobe -v error -count_frames -show_entries stream=nb_read_frames -of csv=p=0 result/motion.mp4 | tr -d ,)
    [ "$frames" = 7 ] || fail "a video of 7 pictures, got $frames"
    # pictures differ: what moves is seen
    [ "$(ffmpeg -loglevel error -i result/motion.mp4 -f framemd5 - | grep -v '^#' | awk '{ print $NF }' | sort -u | wc -l)" = 7 ] ||
      fail "pictures of the video are alike"
  else
    fail "no video"
    cat err
  fi
else
  echo "left out: a video (chromium, ffmpeg)"
fi
[ "$failed" -eq 0 ] && echo "all formats are read back"
exit "$failed"
