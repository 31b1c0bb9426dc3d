"use strict";
const cards = [...document.querySelectorAll("article")];
cards.forEach((card, number) => { card.dataset.number = number; });
const at = (id) => document.getElementById(id);
const smallest = { number: 1, likely: 1, force: -1 };

function show() {
  const words = at("words").value.toLowerCase().split(/\s+/).filter(Boolean);
  let shown = 0;
  for (const card of cards) {
    const text = card.textContent.toLowerCase();
    const failed = card.classList.contains("failed");
    const fits = words.every((word) => text.includes(word))
      && (!at("kind").value || card.dataset.kind === at("kind").value)
      && (failed ? +at("below").value > 1 : +card.dataset.likely < +at("below").value)
      && (!at("lacking").checked || failed || +card.dataset.lacking > 0);
    card.hidden = !fits;
    shown += fits;
  }
  at("shown").textContent = `${shown} of ${cards.length}`;
}

function sort() {
  const by = at("order").value;
  const value = (card) => (by in card.dataset ? smallest[by] * card.dataset[by] : Infinity);
  cards.sort((a, b) => value(a) - value(b) || a.dataset.number - b.dataset.number);
  document.querySelector("main").append(...cards);
}

at("filters").addEventListener("input", () => { sort(); show(); });
at("filters").addEventListener("submit", (event) => event.preventDefault());
document.querySelector("main").addEventListener("click", async (event) => {
  if (event.target.tagName !== "BUTTON") return;
  const code = event.target.closest("article").querySelector("code");
  getSelection().selectAllChildren(code);
  try {
    await navigator.clipboard.writeText(code.textContent);
    event.target.textContent = "copied";
  } catch {
    event.target.textContent = "selected below: copy it";
  }
});
show();
