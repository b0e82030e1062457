#!/usr/bin/env python3
"""Commands and snippets of the documents, run as they are written. Usage: test_documents.py SOURCE BUILD [DOCUMENT...]

Every *.md of the repository is read. A fenced block says its language: sh commands are run, one a line, in a folder that has
what the root of a clone has; c is compiled without a warning, and linked where it has a main; xml is read by the tool; a block
with file=NAME behind its language is written there first; python has to parse (its own tests run it); text behind a sh block is
what the last command prints: each line of it has to be there, numbers aside, but for lines with "...". A command exits with 0, or with what a
comment behind it says: # exit status 1.

What cannot be run as it stands is in documents.txt, a line each: DOCUMENT | COMMAND | run: what is run in its place, or not run:
why; the command * is all of them. Exceptions are counted, and one that no document needs is an error. Code between single backticks that calls the tool has
to name a command and options of it that exist; scripts that it calls have to exist.
"""
import ast, os, re, shutil, subprocess, sys, tempfile

source, build = map(os.path.abspath, sys.argv[1:3])
tool = os.path.join(build, 'problems', 'cavort')
LANGUAGES = {'sh', 'c', 'xml', 'python', 'text', 'csv', 'json'}
COMMANDS = re.compile(r' {4}(sh|meson|build/|cavort|gcc|git|python3?|pip|npm|node|CC=|\.ci/|chromium)\b|    \.ci/')
WRAPPED = '<problem name="snippet"><horizon duration="1"/><start key="stand" height="floor"/>%s</problem>'
failures, counts = [], {'commands run': 0, 'commands run otherwise': 0, 'commands not run': 0, 'snippets': 0, 'mentions': 0}


def fail(document, line, text):
    failures.append('%s:%d: %s' % (document, line, text))


def documents():
    for folder, folders, names in os.walk(source):
        folders[:] = sorted(f for f in folders if not re.match(r'build|\.|results$|node_modules', f))
        for name in sorted(names):
            if name.endswith('.md'):
                yield os.path.relpath(os.path.join(folder, name), source)


class Block:
    def __init__(self, line, info):
        words = info.split()
        self.line, self.language = line, words[0] if words else ''
        self.file = next((w[5:] for w in words[1:] if w.startswith('file=')), None)
        self.lines = []


def blocks(document, text):
    block = None
    for number, line in enumerate(text.splitlines(), 1):
        fence = re.match(r' {0,3}```(.*)', line)
        if fence and block is None:
            block = Block(number, fence.group(1))
        elif fence:
            yield block
            block = None
        elif block is not None:
            block.lines.append(line)
        elif COMMANDS.match(line):
            fail(document, number, 'commands stand in a block that begins with ```sh: ' + line.strip())
    if block is not None:
        fail(document, block.line, 'a block without an end')


def commands(block):
    """Lines of a block, joined where they end in a backslash; comments alone are none."""
    at, whole = block.line, ''
    for number, line in enumerate(block.lines, block.line + 1):
        if not whole:
            at = number
        whole += line.rstrip('\\').rstrip() + ' ' if line.endswith('\\') else line
        if line.endswith('\\'):
            continue
        if whole.strip() and not whole.lstrip().startswith('#'):
            yield at, whole.strip()
        whole = ''


def plain(text):
    """Text to compare: numbers and lengths of white space do not count."""
    return re.sub(r'\s+', ' ', re.sub(r'-?\d[\d.]*(e[+-]?\d+)?', '0', text)).strip()


class Exceptions:
    def __init__(self, path):
        self.rule, self.used = {}, set()
        for number, line in enumerate(open(path), 1):
            if not line.strip() or line.startswith('#'):
                continue
            part = [p.strip() for p in line.split(' | ', 2)]
            if len(part) != 3 or not re.match(r'(not )?run: .', part[2]):
                fail('tests/documents.txt', number, 'expected DOCUMENT | COMMAND | run: ... or not run: ...')
                continue
            key = part[0], re.sub(r'\s+', ' ', part[1])
            if key in self.rule:
                fail('tests/documents.txt', number, 'a second rule for ' + part[1])
            self.rule[key] = part[2]

    def find(self, document, command):
        """The rule of a command of a document, or that of all its commands, *."""
        for key in (document, re.sub(r'\s+', ' ', re.sub(r'\s+#.*', '', command)).strip()), (document, '*'):
            if key in self.rule:
                self.used.add(key)
                return self.rule[key]
        return None


class Scratch:
    """A folder with what the root of a clone has, where commands leave what they make."""
    def __init__(self):
        self.path = tempfile.mkdtemp(prefix='cavort-documents-')
        for name in os.listdir(source):
            if not re.match(r'build|\.git$|results$', name):
                os.symlink(os.path.join(source, name), os.path.join(self.path, name))
        os.symlink(build, os.path.join(self.path, 'build'))
        self.env = dict(os.environ, PATH=os.path.join(build, 'problems') + ':' + os.environ['PATH'], LC_ALL='C.UTF-8',
                        PKG_CONFIG_PATH=os.path.join(build, 'meson-uninstalled'), CPATH=os.path.join(source, 'include'))

    def write(self, name, text):
        path = os.path.join(self.path, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, 'w') as file:
            file.write(text)
        return path

    def run(self, command):
        try:
            done = subprocess.run(['sh', '-c', command], cwd=self.path, env=self.env, stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, timeout=300)
            return done.returncode, done.stdout.decode(errors='replace')
        except subprocess.TimeoutExpired:
            return -1, 'not done after 300 s'

    def close(self):
        shutil.rmtree(self.path)


def run_commands(document, block, scratch, exceptions):
    """Runs a sh block; what its last command printed."""
    printed = ''
    for line, command in commands(block):
        rule = exceptions.find(document, command)
        if rule and rule.startswith('not run:'):
            counts['commands not run'] += 1
            continue
        counts['commands run otherwise' if rule else 'commands run'] += 1
        taken = rule[4:].strip() if rule else command
        wanted = re.search(r'# exit status (\d+)', taken)
        status, printed = scratch.run(taken)
        if status != (int(wanted.group(1)) if wanted else 0):
            fail(document, line, 'exit status %d: %s\n    %s' % (status, taken, '\n    '.join(printed.splitlines()[-8:])))
    return printed


def check_text(document, block, printed):
    lines = [plain(line) for line in printed.splitlines()]
    for number, line in enumerate(block.lines, block.line + 1):
        if line.strip() and '...' not in line and plain(line) not in lines:
            fail(document, number, 'not printed: %s\n    %s' % (line, '\n    '.join(printed.splitlines()[-12:])))


def check_c(document, block, scratch):
    text = '\n'.join(block.lines) + '\n'
    path = scratch.write(block.file or 'snippet.c', text)
    linked = '-o snippet $(pkg-config --libs cavort)' if re.search(r'\bint main\(', text) else '-c -o snippet.o'
    status, printed = scratch.run('gcc -std=c17 -Wall -Wextra -Werror $(pkg-config --cflags cavort) %s %s' %
                                  (path, linked))
    if status:
        fail(document, block.line, 'does not compile: ' + printed)


def check_xml(document, block, scratch):
    text = '\n'.join(block.lines) + '\n'
    root = re.search(r'<(\w+)', text).group(1)
    path = scratch.write(block.file or 'snippet.xml', text if root in ('problem', 'mujoco') else WRAPPED % text)
    # a problem that names a file of its own keeps it
    model = re.search(r'<problem[^>]*\bmodel="([^"]*)"', text)
    own = root == 'mujoco' or (model and os.path.exists(os.path.join(scratch.path, model.group(1))))
    status, printed = scratch.run('cavort inspect %s%s' % (path, '' if own else ' --model problems/models/humanoid.xml'))
    # what is read and proven impossible ends with 1, too
    if status and not (status == 1 and re.search('^impossible: ', printed, re.M)):
        fail(document, block.line, 'cannot be read: ' + printed)


def check_block(document, block, scratch, exceptions, printed):
    if block.language not in LANGUAGES:
        fail(document, block.line, 'a block says its language, one of: ' + ', '.join(sorted(LANGUAGES)))
    elif block.language == 'sh':
        return run_commands(document, block, scratch, exceptions)
    elif block.language == 'text':
        check_text(document, block, printed)
    else:
        counts['snippets'] += 1
    if block.language == 'c':
        check_c(document, block, scratch)
    elif block.language == 'xml':
        check_xml(document, block, scratch)
    elif block.language == 'python':
        try:
            ast.parse('\n'.join(block.lines))
        except SyntaxError as error:
            fail(document, block.line, 'does not parse: %s' % error)
    elif block.file:
        scratch.write(block.file, '\n'.join(block.lines) + '\n')
    return printed


known_options = {}


def options_of(command):
    if command not in known_options:
        done = subprocess.run([tool, 'help', command], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        text = done.stdout.decode()
        known_options[command] = set(re.findall(r'(?<![\w-])--?[a-z][\w-]*', text)) if \
            text.startswith('cavort ' + command) else None
    return known_options[command]


def check_mentions(document, text):
    """Calls of the tool and of scripts between single backticks."""
    text = re.sub(r'^ {0,3}```.*?^ {0,3}```', lambda m: '\n' * m.group(0).count('\n'), text, flags=re.S | re.M)
    for found in re.finditer(r'(?<!`)`([^`\n]+)`(?!`)', text):
        line, words = text.count('\n', 0, found.start()) + 1, found.group(1).split()
        if re.fullmatch(r'(build/problems/)?cavort', words[0]) and len(words) > 1 and re.fullmatch('[a-z]+', words[1]):
            counts['mentions'] += 1
            options = options_of(words[1])
            if options is None:
                fail(document, line, 'there is no command cavort ' + words[1])
            for word in words[2:]:
                name = re.match(r'\[?(--?[a-z][\w-]*)', word)
                if options is not None and name and name.group(1) not in options:
                    fail(document, line, 'cavort %s has no option %s' % (words[1], name.group(1)))
        elif words[0] == 'sh' and len(words) > 1 and re.match(r'[\w/]+\.sh$', words[1]):
            counts['mentions'] += 1
            if not os.path.exists(os.path.join(source, words[1])):
                fail(document, line, 'there is no ' + words[1])


def read(document):
    with open(os.path.join(source, document), encoding='utf-8') as file:
        return file.read()


def check_document(document, text, exceptions):
    scratch, printed = Scratch(), ''
    try:
        for block in blocks(document, text):
            printed = check_block(document, block, scratch, exceptions, printed)
    finally:
        scratch.close()
    # what was is told under its name of then
    if document != 'CHANGELOG.md':
        check_mentions(document, text)


# each line of it is wrong in one way
CONTROL = """
    cavort help terms

`cavort fly DIR`, `cavort solve PROBLEM --wings`, `sh tests/nowhere.sh`

```sh
cavort help nothing
cavort help terms   # exit status 1
cavort help solve
```
```text
cavort salve PROBLEM
```
```c
int main(void) { return nothing; }
```
```xml
<cost><posture weigt="1"/></cost>
```
```python
def
```
```
cavort help
```
"""


def control():
    check_document('a control', CONTROL, Exceptions(os.devnull))
    found, wanted = len(failures), 11
    failures.clear()
    for what in counts:
        counts[what] = 0
    if found != wanted:
        fail('a control', 0, '%d faults were found of %d' % (found, wanted))


control()
exceptions = Exceptions(os.path.join(source, 'tests', 'documents.txt'))
chosen = sys.argv[3:]
for document in chosen or documents():
    check_document(document, read(document), exceptions)
if not chosen:
    for unused in sorted(set(exceptions.rule) - exceptions.used):
        fail('tests/documents.txt', 0, 'no document needs this exception: %s | %s' % unused)
print('\n'.join('failed: ' + text for text in failures))
print(', '.join('%d %s' % (n, what) for what, n in counts.items()))
sys.exit(1 if failures else 0)
