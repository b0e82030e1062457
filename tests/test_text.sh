#!/bin/sh
# The text of the sources: words that meant something here alone stay away, and what comments name exists: files, functions,
# sections of METHOD.md. Usage: test_text.sh SOURCE
set -u
cd "$1" || exit 1
exec python3 - <<'TEXT'
import os, re, sys

failures, checks = [], 0
files = []
for top in ('include', 'dynamics', 'optim', 'problems', 'tests'):
    for folder, _, names in os.walk(top):
        files += [os.path.join(folder, n) for n in names]
files += ['README.md', 'meson.build', 'meson_options.txt']
sources = [f for f in files if f.endswith(('.c', '.h'))]
texts = {f: open(f, encoding='utf-8').read() for f in files
         if f.endswith(('.c', '.h', '.md', '.sh', '.html', '.build', '.txt')) and '/fuzz/' not in f and 'results/' not in f}

# the words and what stands for them; identifiers and prose of the layers, READMEs, help texts
words = [
    (r'\bcav_(ties?|slopes?|half|halves|demand|audit|finding|apart|routes?|drive|omit|rest|multiply|recover|continue|stroke|vary|find|turn|reach|cone)\b', 'see the table of names'),
    (r'\bties?\b|_ties?\b|\btie_', 'equality (constraint)'), (r'\bslopes?\b|_slopes?\b|\bslopes?_', 'derivative, Jacobian'),
    (r'\bhalfway\b|\bhalves\b', 'half step'), (r'\baudits?\b|_audit\b|\baudit_', 'verification'),
    (r'\bfindings?\b', 'metric'), (r'\bevidence\b', 'metric'), (r'\bjudge[ds]?\b', 'check, verify'), (r'\bown[_ ]contacts\b', "the model's contact parameters"),
    (r'\bfelt\b', 'active'), (r'\bshares? of\b|_share\b|\bshare_|\bself_share\b', 'fraction, ratio'), (r'CAV_QUANTITY_OVERLAP|<overlap\b', 'self-penetration'),
    (r'\bwrap_(error|rows|knot)\b|\bcav_wrap_(new|free|tangent|configuration|range|point|link|pattern|unroll)\b', 'periodicity'),
    (r'\bmisfits?\b', 'violation'), (r'\blone\b', 'single'), (r'\broutes?\b|--routes|_routes?\b|\broutes?_', 'strategy; tendon path'),
    (r'\bstrokes?\b', 'length range'), (r'\bdrives?\b(?! one| the)', 'actuator'), (r'\bomit(s|ted)?\b|<leave\b', 'remove'),
    (r'\bprice[ds]?\b|_prices?\b|\bprices?_', 'penalty, multiplier'), (r'\bdear\b', 'expensive'), (r'\bguard\b(?<!refsafe guard)', 'refsafe'),
    (r'\bpromise[ds]?\b|PROMISE', 'tolerance'),
]
# where a word has its plain meaning
plain = [r'stroke(-|=|\(\))', r'include guard', r'pen\.stroke', r'no code with', r'FORMER_\w+\(', r'\{"(--)?routes", "', r'route_table']
scope = [f for f in texts if not f.startswith('tests/') and f.endswith(('.c', '.h', '.md', '.html'))]
for f in scope:
    for number, line in enumerate(texts[f].splitlines(), 1):
        checks += 1
        for pattern, instead in words:
            found = re.search(pattern, line, re.I if 'PROMISE' not in pattern else 0)
            if found and not any(re.search(p, line) for p in plain):
                failures.append(f"{f}:{number}: '{found.group(0)}': {instead}")

# what comments and documents name
names = {os.path.basename(f) for f in files} | {f for f in os.listdir('.') if f.endswith('.md')}
declared = set(re.findall(r'\b(cav_\w+)', ' '.join(re.sub(r'//[^\n]*', '', texts[f]) for f in sources)))
sections = {l: set(re.findall(r'^## (\d+)\.', texts[l + '/METHOD.md'], re.M)) for l in ('dynamics', 'optim')}
made = {'viewer_page.h', 'cavort.pc', 'meson-private'}
# and what a document tells its reader to write
made |= {name for f in texts if f.endswith('.md') for name in re.findall(r'^```\w+ file=(\S+)', texts[f], re.M)}
for f in texts:
    layer = f.split('/')[0]
    for number, line in enumerate(texts[f].splitlines(), 1):
        text = ''.join(re.findall(r'//.*', line)) if f.endswith(('.c', '.h')) else line if f.endswith('.md') else ''
        if not text:
            continue
        for name in re.findall(r'(?<![\w/.<"-])(?:[\w-]+/)*([\w-]+\.(?:c|h|sh|md))(?![\w(])', text):
            checks += 1
            if name not in names | made and not re.search(r'CHANGELOG|/work|your_', line):
                failures.append(f'{f}:{number}: no file {name}')
        for name in re.findall(r'\b(cav_\w+)\b(?!\*)', text):
            checks += 1
            if name not in declared:
                failures.append(f'{f}:{number}: no function or type {name}')
        for other, section in re.findall(r'(?:(dynamics|optim)/)?METHOD\.md`?, (\d+)', text):
            checks += 1
            where = other or layer
            if where not in sections or section not in sections[where]:
                failures.append(f'{f}:{number}: no section {section} in METHOD.md of {where}')

# comments within the column limit
for f in sources:
    for number, line in enumerate(texts[f].splitlines(), 1):
        checks += 1
        if len(line) > 130 and '"' not in line:
            failures.append(f'{f}:{number}: {len(line)} columns')

print('\n'.join('failed: ' + x for x in failures))
print(f'{checks} checks, {len(failures)} failed')
sys.exit(1 if failures else 0)
TEXT
