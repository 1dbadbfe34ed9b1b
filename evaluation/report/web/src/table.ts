// A table that sorts by any column, and shows long lists page by page.
import { button, type Child, count, element } from "./dom";

export type Cell = string | number | null;

export type Column<Row> = {
  title: string;
  /** What is sorted by; null comes last whatever the direction. */
  value: (row: Row) => Cell;
  /** What is shown. */
  show: (row: Row) => Child;
  /** Numbers stand to the right. */
  isNumber?: boolean;
  /** What the column shows, for the heading's tooltip. */
  hint?: string;
};

const PAGE = 25;

export class SortedTable<Row> {
  readonly root: HTMLElement;
  private rows: readonly Row[] = [];
  private sorted: Row[] = [];
  private page = 0;
  private readonly body = element("tbody");
  private readonly heads: HTMLTableCellElement[];
  private readonly position = element("span", { role: "status" });
  private readonly before: HTMLButtonElement;
  private readonly after: HTMLButtonElement;
  private readonly pager: HTMLElement;

  constructor(
    private readonly name: string, private readonly columns: readonly Column<Row>[],
    private by: number, private isDescending = false, private readonly what = "row",
  ) {
    this.heads = columns.map((column, place) => {
      const press = button("", () => this.sortBy(place), {
        class: "sort", ...(column.hint === undefined ? {} : { title: column.hint }),
      });
      press.append(column.title, element("span", { class: "arrow", "aria-hidden": "true" }));
      return element("th", { scope: "col", class: column.isNumber === true ? "number" : "" }, press);
    });
    this.before = button("Previous", () => this.turn(-1));
    this.after = button("Next", () => this.turn(1));
    this.pager = element("div", { class: "pager" }, this.before, this.position, this.after);
    const table = element("table", {},
      element("caption", { class: "hidden" }, name),
      element("thead", {}, element("tr", {}, ...this.heads)), this.body);
    this.root = element("div", {},
      element("div", { class: "scrolling", role: "region", "aria-label": name, tabindex: 0 }, table), this.pager);
  }

  /** Shows other rows, sorted as before. */
  show(rows: readonly Row[]): void {
    this.rows = rows;
    this.page = 0;
    this.sort();
  }

  private sortBy(place: number): void {
    this.isDescending = this.by === place ? !this.isDescending : false;
    this.by = place;
    this.page = 0;
    this.sort();
  }

  private sort(): void {
    const column = this.columns[this.by];
    if (column === undefined) return;
    const keyed = this.rows.map((row) => ({ row, key: column.value(row) }));
    const sign = this.isDescending ? -1 : 1;
    keyed.sort((a, b) => {
      if (a.key === null || b.key === null) return Number(a.key === null) - Number(b.key === null);
      return sign * (typeof a.key === "number" && typeof b.key === "number"
        ? a.key - b.key : NATURAL.compare(String(a.key), String(b.key)));
    });
    this.sorted = keyed.map(({ row }) => row);
    this.heads.forEach((head, place) => {
      const order = this.isDescending ? "descending" : "ascending";
      if (place === this.by) head.setAttribute("aria-sort", order); else head.removeAttribute("aria-sort");
    });
    this.render();
  }

  private turn(by: number): void {
    this.page += by;
    this.render();
    const pressed = by > 0 ? this.after : this.before;
    // A button that can no longer be pressed gives its focus to the other one.
    if (pressed.disabled) (by > 0 ? this.before : this.after).focus();
  }

  private render(): void {
    const [first, all] = [this.page * PAGE, this.sorted.length];
    const shown = this.sorted.slice(first, first + PAGE);
    this.body.replaceChildren(...shown.map((row) => this.line(row)));
    if (all === 0) {
      this.body.append(element("tr", {},
        element("td", { colspan: this.columns.length }, "Nothing is left by these filters.")));
    }
    this.pager.hidden = all <= PAGE;
    this.before.disabled = this.page === 0;
    this.after.disabled = first + PAGE >= all;
    this.position.textContent = `${first + 1} to ${Math.min(first + PAGE, all)} of ${count(all, this.what)}`;
    this.before.setAttribute("aria-label", `Previous ${PAGE}, ${this.name}`);
    this.after.setAttribute("aria-label", `Next ${PAGE}, ${this.name}`);
  }

  private line(row: Row): HTMLTableRowElement {
    return element("tr", {}, ...this.columns.map((column, place) => {
      const kind = column.isNumber === true ? { class: "number" } : {};
      return place === 0 ? element("th", { scope: "row" }, column.show(row)) : element("td", kind, column.show(row));
    }));
  }
}

const NATURAL = new Intl.Collator("en", { numeric: true });
