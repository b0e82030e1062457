#!/usr/bin/env python3
"""<parameter> of problem files through the tool, against simulations of other equations than ours. Usage: test_parameters.py SOURCE BUILD

A cart that slides under a pole: equations of motion with Coulomb's friction, by Runge and Kutta's rule, noise on places and forces. Two
masses and the friction are found within 1 %, from values a third off; so are they from problems/estimate, whose record is this one
(test_parameters.py --record writes it). A mass on a spring: the stiffness that its period says. What a record cannot tell is refused by
name, or marked, wherever the search begins; places of markers on a pendulum are found; wrong files are refused with line and cure."""
import csv
import math
import os
import random
import re
import subprocess
import sys
import tempfile

CART, POLE, MU, LENGTH, RADIUS, G = 6.0, 1.4, 0.45, 0.4, 0.03, 9.81
failures = []


def check(ok, text):
    if not ok:
        failures.append(text)
        print('failed:', text)
    return ok


# ---------------------------------------------------------------- the truth

def capsule(mass):
    """Moment of inertia of the pole across its axis, about its middle."""
    tube, ends = math.pi * RADIUS ** 2 * LENGTH, 4 / 3 * math.pi * RADIUS ** 3
    a, b = mass * tube / (tube + ends), mass * ends / (tube + ends)
    return a * (RADIUS ** 2 / 4 + LENGTH ** 2 / 12) + b * (0.4 * RADIUS ** 2 + LENGTH ** 2 / 4 + 3 / 8 * LENGTH * RADIUS)


def efforts(t):
    return 36 + 14 * math.sin(9 * t), 2.5 * math.sin(6 * t)


def rates(s, t):
    """Of (x, angle, their rates); the cart slides forward all the time, its normal force is that of cart and pole."""
    _, angle, v, w = s
    push, bend = efforts(t)
    c, si, r = math.cos(angle), math.sin(angle), LENGTH / 2
    a11, a12 = CART + POLE, POLE * r * (c - MU * si)
    b1 = push + POLE * r * w * w * si - MU * ((CART + POLE) * G - POLE * r * w * w * c)
    a21, a22, b2 = POLE * r * c, capsule(POLE) + POLE * r * r, bend + POLE * G * r * si
    d = a11 * a22 - a12 * a21
    return v, w, (b1 * a22 - a12 * b2) / d, (a11 * b2 - a21 * b1) / d


def simulate(duration, h, parts=20):
    s, rows = [0.0, math.pi - 0.5, 0.5, 0.0], []
    for k in range(round(duration / h) + 1):
        rows.append((k * h, *s, *efforts(k * h)))
        for i in range(parts):
            d, t = h / parts, k * h + i * h / parts
            k1 = rates(s, t)
            k2 = rates([a + d / 2 * b for a, b in zip(s, k1)], t + d / 2)
            k3 = rates([a + d / 2 * b for a, b in zip(s, k2)], t + d / 2)
            k4 = rates([a + d * b for a, b in zip(s, k3)], t + d)
            s = [a + d / 6 * (p + 2 * q + 2 * r + u) for a, p, q, r, u in zip(s, k1, k2, k3, k4)]
        assert s[2] > 0.05
    return rows


def write_record(path, seed):
    noise = random.Random(seed)
    with open(path, 'w') as out:
        out.write('time,x,z,angle,push,bend\n')
        for t, x, angle, v, w, push, bend in simulate(0.8, 0.004):
            out.write('%.6g,%.6f,%.6f,%.6f,%.4f,%.5f\n' % (t, x + noise.gauss(0, 2e-4), noise.gauss(0, 2e-4),
                                                        angle + noise.gauss(0, 1e-3), push + noise.gauss(0, 0.05), bend + noise.gauss(0, 0.005)))


def write_guess(path):
    with open(path, 'w') as out:
        out.write('time,qpos_x,qpos_z,qpos_angle\n')
        for t, x, angle, *_ in simulate(0.8, 0.1, 500):
            out.write('%.6g,%.2f,0,%.2f\n' % (t, x, angle))


# ---------------------------------------------------------------- through the tool

def run(*arguments):
    done = subprocess.run([tool, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True,
                          timeout=300)
    return done.returncode, done.stdout


def found(folder):
    with open(os.path.join(folder, 'parameters.csv')) as file:
        return {row['name']: row for row in csv.DictReader(file)}


def near(row, truth, fraction, what):
    value = float(row['value'])
    print('%s: %s +- %s, is %g (%.3f %%)' % (what, row['value'], row['standard_error'], truth, 100 * (value / truth - 1)))
    check(abs(value / truth - 1) < fraction, '%s: %g is not %g' % (what, value, truth))


def test_cart(problem, folder):
    status, text = run('solve', problem, '--threads', '1', '-o', folder)
    check(status == 0, '%s: exit status %d: %s' % (problem, status, text[-600:]))
    if status:
        return
    rows = found(folder)
    near(rows['mass of cart'], CART, 0.01, 'cart, kg')
    near(rows['mass of pole'], POLE, 0.01, 'pole, kg')
    near(rows['friction of runner'], MU, 0.01, 'friction')
    check(all(row['identifiable'] == 'yes' for row in rows.values()), 'what the record tells is not said to be told')
    check(rows['mass of cart']['start'] == '8' and rows['mass of cart']['unit'] == 'kg', 'start or unit')
    check('mass of pole' in text and 'identifiable' in text and 'model.xml' in text, 'no table is printed')
    # the folder is one of the model that was found, whatever reads it
    for model in [], ['--model', os.path.join(folder, 'model.xml')]:
        status, text = run('verify', folder, *model)
        check(status == 0, 'verify %s: %s' % (model, text[-300:]))
    check(run('view', folder)[0] == 0 and run('solve', problem, '--resume', '-o', folder)[0] == 2, 'view, or --resume')
    with open(os.path.join(folder, 'problem.xml')) as file:
        value = re.search(r'type="mass" body="pole" value="([^"]*)"', file.read())
    check(value and float(value.group(1)) == float(rows['mass of pole']['value']), 'problem.xml has another value')


PROBLEM = """<problem name="p" model="%s"><horizon duration="1" timestep="0.01" close="open"/><start free="true"/>
%s<cost><track file="%s" joints="all" sd="%s"/>%s<posture weight="0"/><velocity dofs="all" weight="1e-4"/><acceleration weight="0"/>
<effort weight="0"/><gap weight="0"/><impact weight="0"/><slip weight="0"/></cost></problem>
"""


def write(name, text):
    with open(name, 'w') as out:
        out.write(text)
    return name


def test_spring():
    """Stiffness by the period, k = m (2 pi/T)^2, of a record without noise to speak of."""
    period, mass = 0.7, 2.0
    write('spring_model.xml', '<mujoco model="spring"><option gravity="0 0 0"/><worldbody><body name="mass"><joint '
          'name="x" type="slide" axis="1 0 0" stiffness="100"/><geom size=".1" mass="2"/></body></worldbody></mujoco>')
    write('spring.csv', 'time,x\n' + ''.join('%.3f,%.8f\n' % (k * 0.01, 0.1 * math.cos(2 * math.pi / period * k * 0.01))
                                            for k in range(101)))
    for value in 100, 240:
        write('spring.xml', PROBLEM % ('spring_model.xml', '<parameter type="stiffness" joint="x" value="%d"/>' % value,
                                       'spring.csv', '0.001', ''))
        status, text = run('solve', 'spring.xml', '--threads', '1', '-o', 'spring%d' % value)
        if os.path.exists('spring%d/parameters.csv' % value):
            near(found('spring%d' % value)['stiffness of x'], mass * (2 * math.pi / period) ** 2, 0.002, 'spring, N/m')
        else:
            check(0, 'spring: ' + text[-400:])
    write('spring.xml', PROBLEM % ('spring_model.xml', '<parameter type="stiffness" joint="x" value="120" upper="150"/>',
                                   'spring.csv', '0.001', ''))
    status, text = run('solve', 'spring.xml', '--threads', '1', '-o', 'bounded')
    check('at its upper bound' in text and 'its bound holds stiffness of x -1' in text, 'bound: ' + text[-400:])
    check(float(found('bounded')['stiffness of x']['value']) == 150, 'a bound is passed')
    # what is not there: a spring of a mass that moves on, a shade faster than it would without
    write('free_model.xml', open('spring_model.xml').read().replace('stiffness="100"', 'stiffness="20"'))
    for name, bend in ('free', 0), ('repelled', 1e-3):
        write(name + '.csv', 'time,x\n' + ''.join('%.3f,%.8f\n' % (k * 0.01, k * 0.01 + bend * (k * 0.01) ** 3)
                                                  for k in range(101)))
        write('free.xml', PROBLEM % ('free_model.xml', '<parameter type="stiffness" joint="x" value="20"/>',
                                     name + '.csv', '0.001', ''))
        status, text = run('solve', 'free.xml', '--threads', '1', '-o', name)
        if check(os.path.exists(name + '/parameters.csv'), name + ': ' + text[-400:]):
            row = found(name)['stiffness of x']
            check(0 <= float(row['value']) <= 4 * float(row['standard_error']) and row['identifiable'] == 'yes',
                  name + ': ' + str(row))
            check(bend == 0 or (float(row['value']) == 0 and row['at_bound'] == 'lower'), name + ': ' + str(row))


PAIR = """<mujoco model="pair"><option gravity="0 0 0"/><worldbody><body name="one"><joint name="x" type="slide" axis="1 0 0"/>
<geom size=".1" mass="2"/><body name="two" pos="0 0 .3"><geom size=".1" mass="1"/><site name="mark"/></body></body><site name="post"/>
<body name="still"><joint name="y" type="slide" axis="0 1 0"/><geom size=".1" pos="0 0 2" mass="1"/></body>
<body name="wall"><geom name="brick" size=".1" pos="5 5 5" mass="3" contype="0" conaffinity="0"/></body></worldbody><actuator>
<motor name="push" joint="x" forcerange="-90 90"/><motor name="hold" joint="y" forcerange="-90 90"/></actuator></mujoco>
"""
FORCES = '<track file="pair.csv" sensors="all" sd="0.01"><sensor name="push" type="actuatorfrc" actuator="push"/></track>'


def test_places():
    """Markers on a damped pendulum, off by 2 to 4 cm in the model: its motion by Runge and Kutta's rule, noise on angle and markers."""
    markers, sd = {'knee': (0.03, 0.012, -0.22), 'heel': (-0.02, -0.03, -0.41)}, 0.001
    mass, length, inertia, damping = 1.5, 0.2, 0.05, 0.02
    source_of_noise = random.Random(7)

    def turn(s):
        return s[1], -(mass * G * length * math.sin(s[0]) + damping * s[1]) / (inertia + mass * length ** 2)

    s, h, rows = [0.9, 0.0], 0.0005, []
    for k in range(2001):
        if k % 20 == 0:
            c, n = (math.cos(s[0]), math.sin(s[0])), source_of_noise.gauss
            row = [k * h, s[0] + n(0, 0.001)]
            for x, y, z in markers.values():
                row += [x * c[0] + z * c[1] + n(0, sd), y + n(0, sd), 2 - x * c[1] + z * c[0] + n(0, sd)]
            rows.append(row)
        k1 = turn(s)
        k2 = turn([a + h / 2 * b for a, b in zip(s, k1)])
        k3 = turn([a + h / 2 * b for a, b in zip(s, k2)])
        k4 = turn([a + h * b for a, b in zip(s, k3)])
        s = [a + h / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(s, k1, k2, k3, k4)]
    head = ['time', 'hinge'] + [m + '_' + x for m in markers for x in 'xyz']
    write('places.csv', '\n'.join([','.join(head)] + [','.join('%.9g' % x for x in row) for row in rows]) + '\n')
    # their body's frame is turned by a right angle about y, and moved, in that of the link, which begins at the hinge
    frame = (0.01, 0.02, -0.1)
    places = {m: (frame[2] - p[2], p[1] - frame[1], p[0] - frame[0]) for m, p in markers.items()}
    sites = ''.join('<site name="%s" pos="%g 0 0"/>' % (m, p[0] - 0.03) for m, p in places.items())
    write('places_model.xml', '<mujoco><worldbody><body name="rod" pos="0 0 2"><joint name="hinge" axis="0 1 0" damping="%g"/>'
          '<inertial pos="0 0 %g" mass="%g" diaginertia="%g %g 0.001"/><body name="shell" pos="%g %g %g" '
          'quat="0.70710678118654752 0 0.70710678118654752 0">%s</body></body></worldbody></mujoco>'
          % (damping, -length, mass, inertia, inertia, *frame, sites))
    sensors = ''.join('<sensor name="%s" type="framepos" site="%s"/>' % (m, m) for m in markers)
    unknown = ''.join('<parameter type="place" site="%s" component="%s"/>' % (m, x) for m in markers for x in 'xyz')
    problem = ('<problem name="places" model="places_model.xml"><horizon duration="1" timestep="0.01" close="open"/>'
               '<start free="true" qpos="0.9"/>%s<cost><track file="places.csv" joints="hinge" sd="0.001"/>'
               '<track file="places.csv" sd="0.001">%s</track><posture weight="0"/><velocity weight="0"/><acceleration weight="0"/>'
               '<effort weight="0"/></cost></problem>')
    write('places.xml', problem % (unknown, sensors))
    status, text = run('solve', 'places.xml', '--threads', '1', '-o', 'places')
    if not check(os.path.exists('places/parameters.csv'), 'places: ' + text[-600:]):
        return
    rows = found('places')
    for marker, place in places.items():
        for x, true in zip('xyz', place):
            row = rows['place %s of %s' % (x, marker)]
            value, error = float(row['value']), float(row['standard_error'])
            print('place %s of %s: %.5f +- %.5f m, is %g' % (x, marker, value, error, true))
            check(abs(value - true) < 3.5 * error and abs(value - true) < 0.005 * math.hypot(*place) and
                  row['identifiable'] == 'yes', 'place %s of %s: %g is not %g' % (x, marker, value, true))
    # what is solved afterwards, and the model that is written, have them
    with open('places/problem.xml') as file:
        value = re.search(r'type="place" site="heel" component="x" value="([^"]*)"', file.read())
    check(value and abs(float(value.group(1)) - float(rows['place x of heel']['value'])) < 1e-12, 'problem.xml has another place')
    for model in [], ['--model', 'places/model.xml']:
        status, text = run('verify', 'places', *model)
        check(status == 0, 'verify %s: %s' % (model, text[-300:]))
    # a marker that is not recorded
    write('places.xml', problem % (unknown, sensors.replace('<sensor name="heel" type="framepos" site="heel"/>', '')))
    status, text = run('solve', 'places.xml', '--threads', '1', '-o', 'untold')
    check(status == 2 and 'of heel' in text, 'a site that is not recorded: %d %s' % (status, text[-400:]))


def test_untold():
    """Two masses on one slide pushed by 6 N, a third that rests; none of them, or their sum, is told by positions alone."""
    write('pair_model.xml', PAIR)
    write('pair.csv', 'time,x,y,push\n' + ''.join('%.2f,%.8f,0,6\n' % (k * 0.01, (k * 0.01) ** 2) for k in range(101)))
    one, two = '<parameter type="mass" body="one"/>', '<parameter type="mass" body="two"/>'
    push = FORCES.replace(' sensors="all"', '')
    for what, parameters, record, status, texts in (
            ('both', one + two, push, 2, ('does not tell apart mass of one, mass of two', 'sd')),
            ('rests', one + '<parameter type="mass" body="still"/>', push, 2, ('does not tell mass of still',)),
            ('no force', one, '', 2, ('does not tell mass of one',)),
            ('no force, but effort', one, '<effort weight="5"/>', 2, ('does not tell mass of one',)),
            ('prior', one + two.replace('/>', ' sd="0.1"/>'), push, 0, ('mass of one', 'mass of two', 'no: its value'))):
        write('pair.xml', PROBLEM.replace('<effort weight="0"/>', '' if 'effort' in record else '<effort weight="0"/>')
              % ('pair_model.xml', parameters, 'pair.csv', '0.001', record))
        got, text = run('solve', 'pair.xml', '--threads', '1', '-o', 'pair-' + what.replace(' ', '-'))
        check(got == status and all(t in text for t in texts), '%s: exit status %d: %s' % (what, got, text[-500:]))
    if os.path.exists('pair-prior/parameters.csv'):
        rows = found('pair-prior')
        # 6 N make 2 m/s^2
        check(abs(float(rows['mass of one']['value']) + float(rows['mass of two']['value']) - 3) < 0.01, 'sum of masses')
        check(abs(float(rows['mass of two']['standard_error']) - 0.1) < 1e-3 and rows['mass of two']['identifiable'] == 'no',
              'what the prior alone says is not told so')


def test_passive():
    """A pendulum without any force that was recorded: its period goes with the inertia over the mass, the decay of its swing with the
    damping over both, so neither is told alone, from whatever value the search begins."""
    angle, rate, rows, arm, inertia, h = 1.0, 0.0, [], 1.0, 1.1, 1e-4
    for damping in 0.0, 0.05:
        for k in range(10001):
            if k % 100 == 0:
                rows.append('%.2f,%.8f' % (k * h, angle))
            rate += h * (-G * arm * math.sin(angle) - damping * rate) / inertia
            angle += h * rate
        write('swing.csv', 'time,pivot\n' + '\n'.join(rows) + '\n')
        write('swing_guess.csv', 'time,qpos_pivot\n' + '\n'.join(rows) + '\n')
        rows, angle, rate = [], 1.0, 0.0
        others = ('', '<parameter type="inertia" body="rod"/>') if damping == 0 else ('<parameter type="damping" joint="pivot"/>',)
        for other in others:
            for mass in (0.5, 1, 3):
                write('swing_model.xml', '<mujoco model="swing"><worldbody><body name="rod" pos="0 0 2"><joint name="pivot" axis="0 1 0" '
                      'damping="%g"/><inertial pos="0 0 -1" mass="%g" diaginertia=".1 .1 .1"/></body></worldbody></mujoco>'
                      % (2 * damping, mass))
                write('swing.xml', (PROBLEM % ('swing_model.xml', '<parameter type="mass" body="rod"/>' + other, 'swing.csv', '0.001',
                                               '')).replace('<start', '<guess file="swing_guess.csv"/><start'))
                status, text = run('solve', 'swing.xml', '--threads', '1', '-o', 'swing')
                want = 'does not tell apart mass of rod, ' if other else 'does not tell mass of rod'
                check(status == 2 and want in text, 'passive %s from %g: %d %s' % (other, mass, status, text[-300:]))


def test_bad():
    for attributes, texts in (
            ('body="one"', ("'type'",)),
            ('type="weight" body="one"', ('mass',)),
            ('type="mass"', ('body', 'is missing')),
            ('type="mass" body="on"', ('no body of that name',)),
            ('type="mass" joint="x"', ("type=\"mass\" is of a body", "'body'")),
            ('type="mass" body="wall"', ('never moves',)),
            ('type="friction" geom="brick"', ('touch nothing',)),
            ('type="com" body="one"', ('component', 'x, y or z')),
            ('type="com" body="one" component="w"', ('expected x, y or z',)),
            ('type="mass" body="one" component="x"', ('com',)),
            ('type="place" site="mark"', ('component', 'x, y or z')),
            ('type="place" body="one" component="x"', ('of a site', "'site'")),
            ('type="place" site="post" component="x"', ('never moves',)),
            ('type="mass" body="one" value="0"', ('above 0',)),
            ('type="damping" joint="x" value="-1"', ('0 or more',)),
            ('type="mass" body="one" sd="0"', ('above 0',)),
            ('type="mass" body="one" prior="2"', ("'sd'",)),
            ('type="mass" body="one" lower="3"', ('outside its bounds',)),
            ('type="mass" body="one" lower="3" upper="2"', ('below the upper',)),
            ('type="mass" body="one"/><parameter type="mass" body="one"', ('same as a <parameter>',))):
        write('bad.xml', '<problem name="p" model="pair_model.xml"><horizon duration="1"/><start/>\n<parameter %s/></problem>\n'
              % attributes)
        status, text = run('solve', 'bad.xml', '-o', 'bad')
        check(status == 2 and 'bad.xml:2' in text and all(t in text for t in texts), '%s: %d %s' % (attributes, status, text))
    write('bad.xml', '<problem name="p" model="pair_model.xml"><horizon duration="1"/><start/><parameter type="mass" '
          'body="one"/></problem>')
    status, text = run('solve', 'bad.xml', '-o', 'bad')
    check(status == 2 and 'track' in text, 'without a record: %d %s' % (status, text))


def main():
    work = tempfile.mkdtemp(prefix='cavort-parameters-')
    os.chdir(work)
    example = os.path.join(source, 'problems', 'estimate')
    test_places()
    test_untold()
    test_passive()
    test_bad()
    test_spring()
    test_cart(os.path.join(example, 'cart.xml'), 'example')
    # another record of the same cart
    for name in 'cart.xml', 'cart_model.xml', 'cart_guess.csv':
        with open(os.path.join(example, name)) as file:
            write(name, file.read())
    write_record('cart.csv', 2)
    test_cart('cart.xml', 'other')
    if not failures:
        subprocess.run(['rm', '-rf', work])
    print('%d failed' % len(failures))
    sys.exit(1 if failures else 0)


if sys.argv[1] == '--record':
    write_record('cart.csv', 1)
    write_guess('cart_guess.csv')
else:
    source, build = map(os.path.abspath, sys.argv[1:3])
    tool = os.path.join(build, 'problems', 'cavort')
    main()
