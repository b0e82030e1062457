#!/usr/bin/env python3
"""A public header as Doxygen reads it: lists of kinds (X-macros) written out with their texts, and members that share a line
and its comment each on a line of their own, since Doxygen gives a comment to one of them alone. Usage: doxygen_filter.py FILE"""
import re, sys

text = open(sys.argv[1], encoding='utf-8').read()


def arguments(inside):
    """Arguments of a call, parentheses and strings respected."""
    part, depth, quoted, i = [''], 0, False, 0
    while i < len(inside):
        c = inside[i]
        if c == '\\' and quoted:
            part[-1] += inside[i:i + 2]
            i += 2
            continue
        quoted ^= c == '"'
        depth += (c in '([{') - (c in ')]}') if not quoted else 0
        if c == ',' and depth == 0 and not quoted:
            part.append('')
        else:
            part[-1] += c
        i += 1
    return [p.strip() for p in part]


def calls(body, names):
    """Calls of macros in a body: name and arguments."""
    for found in re.finditer(r'\b(%s)\(' % '|'.join(map(re.escape, names)), body):
        depth, quoted, i = 1, False, found.end()
        while depth:
            if body[i] == '\\' and quoted:
                i += 1
            elif body[i] == '"':
                quoted = not quoted
            elif not quoted:
                depth += (body[i] == '(') - (body[i] == ')')
            i += 1
        yield found.group(1), arguments(body[found.end():i - 1])


macro = {}


def declare(before):
    """Macros as they are after a part of the text: some names are taken again."""
    macro.clear()
    for found in re.finditer(r'^#define (\w+)\(([^)]*)\) ?((?:.*\\\n)*.*)\n', before, re.M):
        macro[found.group(1)] = arguments(found.group(2)), found.group(3).replace('\\\n', '\n')



def said(argument):
    """The text of the last string among arguments."""
    strings = [a for a in argument if a.startswith('"')]
    return re.sub(r'"\s*"', '', strings[-1])[1:-1].replace('\\"', '"') if strings else ''


def member(name, argument):
    """What a macro makes of one entry of a list."""
    parameter, body = macro[name]
    value = dict(zip(parameter, argument))
    for p, a in value.items():
        body = re.sub(r'(##)?\b%s\b(##)?' % re.escape(p), lambda m: a, body)
    line = re.sub(r'\s*##\s*', '', body).strip()
    return '  %s ///< %s' % (line, said(argument) or line.rstrip(',;'))


def expand(found):
    """LIST(MEMBER...) on a line of a declaration, written out."""
    declare(found.string[:found.start()])
    parameter, body = macro.get(found.group(1), (None, None))
    given = arguments(found.group(2))
    if parameter is None or any(g not in macro for g in given):
        return found.group(0)
    which = dict(zip(parameter, given))
    return '\n'.join(member(which[name], a) for name, a in calls(body, parameter))


# a list that fits on the line of its type
text = re.sub(r'^(typedef enum \w+ \{) (CAV_\w+\(CAV_\w+\)) (\} \w+;)$', r'\1\n  \2\n\3', text, flags=re.M)
text = re.sub(r'^ +(CAV_[A-Z_]+)\(((?:CAV_\w+(?:, )?)+)\)$', expand, text, flags=re.M)


text = re.sub(r'^enum \{ (\w+ = \w+) \}; (///<.*)$', r'enum {\n  \1 \2\n};', text, flags=re.M)
text = re.sub(r'^( +CAV_\w+_(?:TYPES|KINDS))$', r'\1 ///< how many there are', text, flags=re.M)
text = re.sub(r'^#(define|undef) CAV_\w+_MEMBER\b.*\n', '', text, flags=re.M)


def split(lines):
    """Members that share a line, one by one."""
    i, before = 0, []
    while i < len(lines):
        line = lines[i]
        if re.match(r' +(const )?[a-z]\w*.*,$', line) and '(' not in line and '///' not in line:
            lines[i + 1] = line + ' ' + lines[i + 1].strip()
            i += 1
            continue
        found = re.match(r'( +)((?:const |unsigned )?\w+) ([*\w\[\], ]+,[*\w\[\], ]+);\s*(?:///<(.*))?$', line)
        if line.lstrip().startswith('///') and '///<' not in line:
            before.append(line.strip()[3:])
        elif not found:
            before = []
        i += 1
        if not found:
            yield line
            continue
        comment = found.group(4) or ''
        while comment and i < len(lines) and lines[i].strip().startswith('///<'):
            comment += lines[i].strip()[4:]
            i += 1
        for name in found.group(3).split(','):
            yield '%s%s %s; ///< %s' % (found.group(1), found.group(2), name.strip(), comment or ' '.join(before))
        before = []


def share(lines):
    """Functions declared one behind the other under one comment share it."""
    comment, function = [], False
    for line in lines:
        if line.startswith('CAV_API') and function:
            yield from comment
        if line.startswith('///'):
            comment = comment + [line] if not function else [line]
            function = False
        elif line.startswith('CAV_API'):
            function = bool(comment)
        elif not (function and line.startswith(' ')):
            comment, function = [], False
        yield line


# the head of a file is of the file
text = '/// @file\n' + '\n'.join(share(split(text.split('\n'))))
# names of elements in comments are no tags
print(re.sub(r'(///<?)(.*)', lambda m: m.group(1) + re.sub(r'<(?=[a-z/])', '&lt;', m.group(2)), text))
