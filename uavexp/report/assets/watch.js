"use strict";
// what has changed is put in the place of what stood there; the page stays where it was scrolled to
setInterval(async () => {
  let text;
  try {
    text = await (await fetch("/")).text();
  } catch {
    document.title = "(no longer watched)";
    return;
  }
  const now = new DOMParser().parseFromString(text, "text/html");
  document.title = now.title;
  for (const name of ["header", "main"]) {
    const place = document.querySelector(name);
    const fresh = now.querySelector(name).innerHTML;
    if (place.dataset.shown !== fresh) {
      place.dataset.shown = fresh;
      place.innerHTML = fresh;
    }
  }
}, 3000);
