// Light and dark: as the system has it until the reader chooses.
import { button } from "./dom";

const KEY = "lidarium-theme";
const watchers: (() => void)[] = [];
const system = window.matchMedia("(prefers-color-scheme: dark)");

/** Whether the page is dark now. */
export function isDark(): boolean {
  const chosen = document.documentElement.dataset["theme"];
  return chosen === undefined ? system.matches : chosen === "dark";
}

/** Calls back when the page turns light or dark, so that what is drawn can follow. */
export function onTheme(act: () => void): void {
  watchers.push(act);
}

/** Returns the button that turns the page light or dark. */
export function themeButton(): HTMLButtonElement {
  const kept = stored();
  if (kept === "dark" || kept === "light") document.documentElement.dataset["theme"] = kept;
  const made = button("", () => {
    const next = isDark() ? "light" : "dark";
    document.documentElement.dataset["theme"] = next;
    store(next);
    changed();
  }, { class: "quiet" });
  const label = (): void => { made.textContent = isDark() ? "Light theme" : "Dark theme"; };
  const changed = (): void => { label(); watchers.forEach((act) => act()); };
  system.addEventListener("change", changed);
  label();
  return made;
}

// A page from the disk may not be allowed to store anything.
function stored(): string | null {
  try { return localStorage.getItem(KEY); } catch { return null; }
}

function store(value: string): void {
  try { localStorage.setItem(KEY, value); } catch { /* the choice holds for this visit */ }
}

/** Returns the value of a colour of the style sheet. */
export function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

type Rgb = [number, number, number];

/** Returns red, green and blue of #rrggbb. */
export function rgb(hex: string): Rgb {
  const value = parseInt(hex.slice(1, 7), 16);
  return [value >> 16, (value >> 8) & 255, value & 255];
}

/** Returns a colour between two: 0 is the first, 1 the second. */
export function mixed(a: string, b: string, share: number): string {
  const [first, second] = [rgb(a), rgb(b)];
  const parts = first.map((value, k) => Math.round(value + ((second[k] ?? 0) - value) * share));
  return `#${parts.map((value) => value.toString(16).padStart(2, "0")).join("")}`;
}

/** Returns a colour of a policy or robot as it can be seen on the ground of the theme. */
export function onGround(hex: string): string {
  if (!isDark()) return hex;
  const [red, green, blue] = rgb(hex);
  const light = (0.2126 * red + 0.7152 * green + 0.0722 * blue) / 255;
  return mixed(hex, "#ffffff", Math.max(0, Math.min(0.55, 0.62 - light)));
}
