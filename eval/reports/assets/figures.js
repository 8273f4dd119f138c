// Figures are drawn when they come into view, and drawn anew when the planner in focus or the theme changes. Plotly comes
// last in the page, so that tables and the replay need not wait for it.

const report = parsed("report");
const places = [...document.querySelectorAll(".figure")];
const inView = new Set();
const stale = new Set(places);

function figureOf(place) {
  const { figure, group } = place.dataset;
  if (group === undefined) return report.figures[figure];
  const picker = document.querySelector(`select[data-group="${group}"]`);
  const of = report.grouped[group]?.[picker?.value];
  return of?.[figure];
}

function draw(place) {
  stale.delete(place);
  const figure = figureOf(place);
  if (figure === undefined) {
    Plotly.purge(place);
    const reason = document.createElement("p");
    reason.textContent = report.missing[place.dataset.figure] ?? "This run has nothing to show here.";
    place.replaceChildren(reason);
    return;
  }
  if (place.firstElementChild?.tagName === "P") place.replaceChildren();
  const { data, layout } = themed(figure);
  if (place.clientWidth < 500) layout.height += 18 * Math.min(data.length, 10); // legends take more lines
  Plotly.react(place, data, layout, { responsive: true, displayModeBar: false });
}

function refresh() {
  if (window.Plotly === undefined) return;
  for (const place of stale) if (inView.has(place)) draw(place);
}

const watcher = new IntersectionObserver(
  (entries) => {
    for (const { target, isIntersecting } of entries) isIntersecting ? inView.add(target) : inView.delete(target);
    refresh();
  },
  { rootMargin: "300px" },
);
places.forEach((place) => watcher.observe(place));

for (const picker of document.querySelectorAll("select[data-group]")) {
  picker.addEventListener("change", () => {
    places.filter((place) => place.dataset.group === picker.dataset.group).forEach((place) => stale.add(place));
    refresh();
  });
}

dark.addEventListener("change", () => {
  places.forEach((place) => stale.add(place));
  refresh();
});
