"use strict";
function copy(button) {
  const code = button.parentElement.querySelector("code");
  const range = document.createRange();
  range.selectNodeContents(code);
  getSelection().removeAllRanges();
  getSelection().addRange(range); // the clipboard may be refused on file://; selected text can be copied
  const copied = document.execCommand("copy");
  button.textContent = copied ? "copied" : "selected";
  setTimeout(() => { button.textContent = "copy"; }, 1500);
}

// a click on a column's name sorts by it: numbers by their size, what has none last
function sortBy(head) {
  const body = head.closest("table").tBodies[0];
  const upward = head.getAttribute("aria-sort") !== "ascending";
  const textOf = (row) => row.cells[head.cellIndex].textContent.trim();
  const numberOf = (row) => Number.parseFloat(textOf(row).replace(/^<\s*/, "").replace("−", "-"));
  const rows = [...body.rows];
  const numeric = rows.filter((row) => !Number.isNaN(numberOf(row))).length > rows.length / 2;
  const keyed = rows.map((row) => [numeric ? numberOf(row) : textOf(row), row]);
  const isLast = (key) => key === "" || key === "–" || Number.isNaN(key);
  keyed.sort(([a], [b]) => {
    if (isLast(a) || isLast(b)) return isLast(a) - isLast(b);
    return (upward ? 1 : -1) * (numeric ? a - b : a.localeCompare(b));
  });
  for (const other of head.parentElement.cells) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", upward ? "ascending" : "descending");
  body.append(...keyed.map(([, row]) => row));
}

function act(event) {
  const button = event.target.closest("button.copy");
  const head = event.target.closest(".sortable th");
  if (button && event.type === "click") copy(button);
  if (head && (event.type === "click" || event.key === "Enter")) sortBy(head);
}
document.addEventListener("click", act);
document.addEventListener("keydown", act);
