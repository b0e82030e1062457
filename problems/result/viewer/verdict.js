// The verdict, of two motions side by side.

function mark_of(passed) {
  const box = node('span', undefined, 'mark ' + (passed === 1 ? 'good' : passed === 0 ? 'bad' : ''));
  if (passed < 0) return box;
  const path = passed === 1 ? 'M2 8l4 4 8-9' : 'M3 3l10 10M13 3L3 13';
  box.innerHTML = `<svg viewBox="0 0 16 16" width="14" height="14" fill="none" stroke="currentColor" stroke-width="2.4"` +
    ` stroke-linecap="round" stroke-linejoin="round" style="display:block"><path d="${path}"/></svg>`;
  box.setAttribute('role', 'img');
  box.setAttribute('aria-label', passed ? 'held' : 'missed');
  return box;
}

function draw_verdict() {
  const labels = [...new Set(motions.flatMap(shown => shown.verdict.map(line => line.label)))];
  if (!labels.length) return;
  const checks = motions.flatMap(shown => shown.verdict).filter(line => line.passed >= 0);
  const missed = checks.filter(line => line.passed === 0).length;
  const card = node('details'), head = node('summary'), table = node('table'), body = node('tbody');
  card.id = 'verdict';
  card.open = missed > 0 || checks.length === 0;
  if (checks.length) head.append(mark_of(missed ? 0 : 1));
  head.append(!checks.length ? 'Verdict' : missed ? `${missed} of ${checks.length} checks missed` : `All ${checks.length} checks held`);
  if (both) {
    const top = node('tr');
    top.append(node('th'), ...motions.map(shown => node('th', shown.label)));
    const names = node('thead');
    names.append(top);
    table.append(names);
  }
  for (const label of labels) {
    const lines = motions.map(shown => shown.verdict.find(line => line.label === label));
    const row = node('tr'), title = node('th', label);
    // what does not fit beside its label stands below it
    const long = lines.some(line => line && line.value.length > 26);
    if (!both) title.prepend(mark_of(lines[0].passed));
    title.scope = 'row';
    row.append(title);
    body.append(row);
    if (long) title.colSpan = 1 + motions.length;
    for (const line of lines) {
      const value = node('td', line ? line.value : '\u2013', (long ? 'long ' : '') + (line && line.passed === 0 ? 'bad' : ''));
      if (both && line && line.passed >= 0) value.append(mark_of(line.passed));
      const place = long ? node('tr') : row;
      if (long) value.colSpan = 1 + motions.length;
      place.append(value);
      if (long) body.append(place);
    }
  }
  table.append(body);
  card.append(head, table);
  by('side').append(card);
}
draw_verdict();
