// Search, sliders and films. Pages can be read without it: then all severities are shown, and films open on their own.
"use strict";
document.documentElement.classList.add("scripted");

// Search: every word must be in a card. Other pages send their words here as ?q=.
const field = document.querySelector("input[type=search]");
const cards = [...document.querySelectorAll(".card")];
const found = document.querySelector(".found");
function search() {
  const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
  let count = 0;
  for (const card of cards) {
    card.hidden = !words.every(word => card.dataset.words.includes(word));
    count += !card.hidden;
  }
  for (const section of document.querySelectorAll(".category"))
    section.hidden = !section.querySelector(".card:not([hidden])");
  document.querySelector("nav.jump").hidden = words.length > 0;
  found.hidden = words.length === 0;
  found.textContent = count ? `${count} of ${cards.length} tasks` : `no task has “${field.value}” in its name, instruction or axes`;
}
if (found) {
  field.value = new URLSearchParams(location.search).get("q") ?? "";
  field.addEventListener("input", search);
  field.form.addEventListener("submit", event => event.preventDefault());
  search();
}
addEventListener("keydown", event => {
  if (event.key === "/" && !event.ctrlKey && !event.metaKey && document.activeElement !== field) {
    event.preventDefault();
    field.focus();
  }
});

// Severities: one is shown at a time.
for (const axis of document.querySelectorAll(".axis")) {
  const slider = axis.querySelector("input[type=range]");
  if (!slider) continue;
  const steps = [...axis.querySelectorAll(".steps figure")];
  const show = () => {
    steps.forEach((step, number) => { step.hidden = number + 1 !== Number(slider.value); });
    axis.querySelector("output").value = `${slider.value} of ${slider.max}`;
  };
  slider.addEventListener("input", show);
  show();
}

// Films play in the place of the picture. They are loaded when they are asked for.
const stage = document.querySelector(".stage");
for (const clip of document.querySelectorAll(".clip"))
  clip.addEventListener("click", event => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    const frame = document.createElement("iframe");
    frame.title = clip.querySelector("b").textContent;
    frame.src = clip.href;
    stage.replaceChildren(frame);
    for (const other of document.querySelectorAll(".clip")) other.toggleAttribute("aria-current", other === clip);
    stage.scrollIntoView({block: "nearest", behavior: "smooth"});
  });
