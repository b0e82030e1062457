#!/usr/bin/env python3
"""Every construction of MJCF that there is a small model of (sweep.txt), asked of ours and of MuJoCo 3.

    CAVORT_MUJOCO_JS=/path/to/mujoco.js tests/sweep.py BUILD

A line of sweep.txt: a name, where the rest stands, the rest. A model that MuJoCo loads has to be loaded, and its inverses have to
be MuJoCo's in ten random states, but for those named below with the reason. Without MuJoCo only loading is looked at."""
import os
import subprocess
import sys
import tempfile

MASS = "<inertial mass='2' pos='.1 0 .2' diaginertia='1 1.2 .9'/>"


def scene(before='', body='', joint='', inside='', after=''):
    """An arm on a hinge, a ball on the floor, and what is asked about."""
    return f"""{before}<worldbody><geom name='floor' type='plane' size='5 5 .1'/><body name='arm' pos='0 0 1' {body}>
<joint name='j' {joint}/>{MASS}<site name='s' pos='.1 .2 .3'/>{inside}</body><body name='free' pos='1 0 .5'><freejoint name='fj'/>
<geom name='ball' size='.1'/><site name='fs'/></body></worldbody>{after}"""


SECOND = "<body name='two' pos='0 0 .5'><joint name='k' axis='0 1 0'/>" + MASS + "<site name='s2'/></body>"
SENSED = """<worldbody><camera name='c' pos='0 0 3' resolution='3 3'/><geom name='floor' type='plane' size='1 1 1'/>
<body name='arm' pos='0 0 1'><joint name='j' range='-20 20' limited='true'/>""" + MASS + """<site name='s'/><body>
<joint name='bl' type='ball'/>""" + MASS + """</body></body><body name='free' pos='1 0 .5'><freejoint/><geom name='ball' size='.1'/>
</body></worldbody><tendon><fixed name='t' range='0 1' limited='true'><joint joint='j' coef='1'/></fixed></tendon>
<actuator><motor name='a' joint='j'/></actuator>"""
PLACES = {
    'model': lambda x: x,
    'before': lambda x: scene(before=x),
    'body': lambda x: scene(body=x),
    'joint': lambda x: scene(joint=x),
    'in': lambda x: scene(inside=x),
    'after': lambda x: scene(after=x),
    'option': lambda x: f'<option {x}/>' + scene(),
    'actuator': lambda x: scene(after=f'<actuator>{x}</actuator>'),
    'tendon': lambda x: scene(inside=SECOND, after=f'<tendon>{x}</tendon>'),
    'sensor': lambda x: SENSED + f'<sensor>{x}</sensor>',
}
# what MuJoCo 3.14 loads and ours names as not supported
LACKING = {
    'composite bodies': ['composite_cable'],
    'meshes from a formula': ['builtin_cone', 'builtin_hemisphere', 'builtin_sphere', 'builtin_supersphere', 'builtin_supertorus'],
    'motors with a circuit, functions of users': ['dcmotor', 'dcmotor2', 'dyn_user'],
    'stiffness and damping that vary': ['act_damp3', 'j_damp2', 'j_stiff2', 't_poly'],
    'inertia of a tendon along several joints': ['act_damp_tendon', 't_arm2', 't_arm_sp'],
    'surfaces that stick or move': ['geom_adhesion', 'geom_surfvel'],
    'signed distance fields': ['geom_sdf'],
    'ellipsoids of meshes in a medium': ['mesh_fluid'],
    'fixed tendons along balls': ['t_ball'],
}
# what both load and take otherwise
DIFFERENT = {
    'coordinates of an aligned body are its own, told': ['j_free_align'],
    'contacts of height fields are found by other means (models.md)': ['geom_hfield_flat', 'hfield_const', 'hfield_elev'],
    'a flag of mj_inverse alone': ['flag_invdiscrete_enable'],
    'negative margins': ['margin_neg'],
    'softness of the friction of one pair, told': ['pair'],
    'refused by MuJoCo: one body tied to itself': ['eq_connect_same'],
}


def named(table):
    """All names of a table of reasons."""
    return {name for names in table.values() for name in names}


def write_models(folder):
    """Files of all lines; their names."""
    names = []
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), 'sweep.txt'), encoding='utf-8') as lines:
        for line in lines:
            name, place, text = line.rstrip('\n').split(' ', 2)
            with open(os.path.join(folder, name + '.xml'), 'w', encoding='utf-8') as out:
                out.write(f'<mujoco>{PLACES[place](text)}</mujoco>\n')
            names.append(name)
    return names


def ask_tool(build, folder, name):
    """Whether the tool loads a model, and what it says where not."""
    done = subprocess.run([os.path.join(build, 'problems', 'cavort'), 'inspect', os.path.join(folder, name + '.xml')],
                          capture_output=True, text=True, check=False)
    return done.returncode == 0, done.stderr.split('\n')[0]


def judge(row):
    """What is wrong with a row of test_today --table; nothing where all is as it should be."""
    name, ours, theirs, states, agree, worst = row.split()
    name = name[:-4]
    if name in named(LACKING):
        return '' if ours == '0' and theirs == '1' else f'{name}: expected to be loaded by MuJoCo alone'
    if theirs == '0' and name not in named(DIFFERENT):
        return f'{name}: MuJoCo does not load it'
    if ours == '0':
        return f'{name}: not loaded'
    # bound: meshes are of single precision there; seen 1e-7
    if name not in named(DIFFERENT) and (states != agree and float(worst) > 1e-6):
        return f'{name}: inverses of {agree} of {states} states agree, the rest to {worst}'
    return ''


def main():
    """Count of what is wrong as exit status."""
    build = sys.argv[1]
    with tempfile.TemporaryDirectory() as folder:
        names, wrong = write_models(folder), []
        peer = os.access(os.environ.get('CAVORT_MUJOCO_JS', ''), os.R_OK)
        if peer:
            table = subprocess.run([os.path.join(build, 'tests', 'test_today'), '--table', folder], capture_output=True, text=True,
                                   check=True).stdout
            rows = [row for row in table.split('\n') if row]
            wrong = [text for text in map(judge, rows) if text]
            if len(rows) != len(names):
                wrong.append(f'{len(rows)} rows of {len(names)} models')
        for name in names if not peer else named(LACKING):
            loads, says = ask_tool(build, folder, name)
            if loads == (name in named(LACKING)):
                wrong.append(f'{name}: {says or "loaded"}')
            elif not loads and 'support' not in says and 'expected' not in says and 'needs' not in says and ' no ' not in says:
                wrong.append(f'{name}: not told to be unsupported: {says}')
    for text in wrong:
        print(text)
    print(f'{len(names)} constructions, {len(named(LACKING))} not supported, compared with MuJoCo 3: {"yes" if peer else "no"}')
    print(f'{len(names) - len(wrong)} passed, {len(wrong)} failed')
    return min(len(wrong), 99)


if __name__ == '__main__':
    sys.exit(main())
