// Elements and texts of the page. Names are only ever set as text, never parsed as HTML.

export type Child = Node | string;
type Attributes = Record<string, string | number | boolean>;

const SVG = "http://www.w3.org/2000/svg";

/** Returns an element with attributes and children. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K, attributes: Attributes = {}, ...children: Child[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  assign(made, attributes);
  made.append(...children);
  return made;
}

/** Returns an element of a drawing. */
export function drawn<K extends keyof SVGElementTagNameMap>(
  tag: K, attributes: Attributes = {}, ...children: Child[]
): SVGElementTagNameMap[K] {
  const made = document.createElementNS(SVG, tag);
  assign(made, attributes);
  made.append(...children);
  return made;
}

function assign(target: Element, attributes: Attributes): void {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === true) target.setAttribute(name, "");
    else if (value !== false) target.setAttribute(name, String(value));
  }
}

/** Returns a button that acts when it is pressed. */
export function button(label: string, act: () => void, attributes: Attributes = {}): HTMLButtonElement {
  const made = element("button", { type: "button", ...attributes }, label);
  made.addEventListener("click", act);
  return made;
}

export type Option = { value: string; label: string };

/** Returns a labelled list of which one entry is chosen. */
export function choice(
  label: string, options: readonly Option[], act: (value: string) => void,
): { field: HTMLLabelElement; select: HTMLSelectElement } {
  const select = element("select");
  setOptions(select, options);
  select.addEventListener("change", () => act(select.value));
  return { field: element("label", { class: "field" }, element("span", {}, label), select), select };
}

/** Replaces the entries of a list; what was chosen stays chosen where it is still there. */
export function setOptions(select: HTMLSelectElement, options: readonly Option[]): void {
  const before = select.value;
  select.replaceChildren(...options.map(({ value, label }) => element("option", { value }, label)));
  if (options.some(({ value }) => value === before)) select.value = before;
}

/** Returns a labelled box to tick. */
export function tick(
  label: Child, isOn: boolean, act: (isOn: boolean) => void,
): { field: HTMLLabelElement; input: HTMLInputElement } {
  const input = element("input", { type: "checkbox" });
  input.checked = isOn;
  input.addEventListener("change", () => act(input.checked));
  return { field: element("label", { class: "tick" }, input, element("span", {}, label)), input };
}

/** Returns a section with a heading and an anchor. */
export function section(id: string, title: string, ...children: Child[]): HTMLElement {
  return element("section", { id, "aria-labelledby": `${id}-title`, class: "card" },
    element("h2", { id: `${id}-title` }, title), ...children);
}

/** Returns a number with so many digits behind the point; a dash for none. */
export function number(value: number | null | undefined, digits = 1): string {
  if (value === null || value === undefined) return "–";
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text;
}

/** Returns a time as minutes and seconds. */
export function clock(seconds: number): string {
  const whole = Math.floor(seconds + 1e-6);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

/** Returns a number of things in words. */
export function count(many: number, what: string): string {
  return `${many.toLocaleString("en")} ${what}${many === 1 ? "" : "s"}`;
}
