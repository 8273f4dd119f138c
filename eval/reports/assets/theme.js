// The colours of the page, for Plotly and for canvases. Figures name them by tokens: "@0", "@text", "@2/0.2".

const dark = window.matchMedia("(prefers-color-scheme: dark)");
const escaped = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
const byId = (id) => document.getElementById(id);
const parsed = (id) => JSON.parse(byId(id).textContent);

function colour(token) {
  const [name, alpha] = token.slice(1).split("/");
  const property = /^\d$/.test(name) ? `--c${name}` : `--${name}`;
  const hex = getComputedStyle(document.documentElement).getPropertyValue(property).trim();
  if (alpha === undefined) return hex;
  const parts = [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
  return `rgba(${parts.join(",")},${alpha})`;
}

const TOKEN = /^@(\d|neutral|text|grid|paper|soft|ground)(\/[\d.]+)?$/;

// A copy of a figure in which tokens are colours.
function themed(value) {
  if (typeof value === "string") return TOKEN.test(value) ? colour(value) : value;
  if (Array.isArray(value)) return value.map(themed);
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([key, held]) => [key, themed(held)]));
}
