// The text of an explanation, opened step by step: a line with deeper lines under it is a summary, they its details.

/** The elements that show a text, whose indentation says what belongs to what. */
export function opened(text) {
  const lines = text.split("\n").filter((line) => line.trim());
  return nodes(lines.map((line) => ({ depth: line.search(/\S/), text: line.trim() })));
}

function nodes(lines) {
  const found = [];
  for (let i = 0; i < lines.length; ) {
    let end = i + 1;
    while (end < lines.length && lines[end].depth > lines[i].depth) end++;
    found.push(end > i + 1 ? details(lines[i].text, lines.slice(i + 1, end)) : element("div", lines[i].text));
    i = end;
  }
  return found;
}

function details(summary, lines) {
  const found = element("details");
  found.append(element("summary", summary), ...nodes(lines));
  return found;
}

export function element(name, text = "") {
  const found = document.createElement(name);
  found.textContent = text;
  if (/\S {3}/.test(text)) found.className = "table";
  return found;
}
