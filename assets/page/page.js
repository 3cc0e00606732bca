// Tabs show one chapter at a time; an element with a tip shows it under the pointer.
"use strict";
const tabs = [...document.querySelectorAll("[role=tab]")];
const show = (id) => {
  if (!tabs.some((tab) => tab.dataset.tab === id)) return;
  for (const tab of tabs) {
    const chosen = tab.dataset.tab === id;
    tab.setAttribute("aria-selected", String(chosen));
    if (chosen) tab.scrollIntoView({ block: "nearest", inline: "nearest" });
    document.getElementById(tab.dataset.tab).hidden = !chosen;
  }
};
for (const tab of tabs) {
  tab.addEventListener("click", () => { show(tab.dataset.tab); history.replaceState(null, "", "#" + tab.dataset.tab); });
}
if (tabs.length > 0) show(tabs[0].dataset.tab);
show(location.hash.slice(1));

const tip = document.getElementById("tip");
const say = (event) => {
  const dot = event.target.closest?.("[data-tip]");
  tip.hidden = !dot;
  if (!dot) return;
  tip.textContent = dot.dataset.tip;
  const { clientX: x, clientY: y } = event, { offsetWidth: w, offsetHeight: h } = tip;
  tip.style.left = Math.max(4, Math.min(x + 14, innerWidth - w - 4)) + "px";
  tip.style.top = (y + h + 24 > innerHeight ? y - h - 12 : y + 16) + "px";
};
document.addEventListener("pointermove", say);
document.addEventListener("pointerdown", say);
