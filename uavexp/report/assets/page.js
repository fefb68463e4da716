"use strict";
for (const button of document.querySelectorAll("button.copy")) {
  button.addEventListener("click", () => {
    const code = button.parentElement.querySelector("code");
    const range = document.createRange();
    range.selectNodeContents(code);
    getSelection().removeAllRanges();
    getSelection().addRange(range); // the clipboard may be refused on file://; selected text can be copied
    const copied = document.execCommand("copy");
    button.textContent = copied ? "copied" : "selected";
    setTimeout(() => { button.textContent = "copy"; }, 1500);
  });
}

// a click on a column's name sorts by it: numbers by their size, what has none last
function sortBy(head, column) {
  const rows = [...head.closest("table").tBodies[0].rows];
  const upward = head.getAttribute("aria-sort") !== "ascending";
  const textOf = (row) => row.cells[column].textContent.trim();
  const numberOf = (row) => Number.parseFloat(textOf(row).replace(/^<\s*/, "").replace("−", "-"));
  const numeric = rows.filter((row) => !Number.isNaN(numberOf(row))).length > rows.length / 2;
  const keyed = rows.map((row) => [numeric ? numberOf(row) : textOf(row), row]);
  const isLast = (key) => key === "" || key === "–" || Number.isNaN(key);
  keyed.sort(([a], [b]) => {
    if (isLast(a) || isLast(b)) return isLast(a) - isLast(b);
    return (upward ? 1 : -1) * (numeric ? a - b : a.localeCompare(b));
  });
  for (const other of head.parentElement.cells) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", upward ? "ascending" : "descending");
  keyed.forEach(([, row]) => row.parentElement.appendChild(row));
}
for (const head of document.querySelectorAll(".sortable th")) {
  head.tabIndex = 0;
  head.title = "sort by this column";
  head.addEventListener("click", () => sortBy(head, head.cellIndex));
  head.addEventListener("keydown", (event) => { if (event.key === "Enter") sortBy(head, head.cellIndex); });
}
