// Elements of the page. Text from documents is inserted as text, never as HTML.

type Child = Node | string;
type More = Record<string, string | number | boolean | ((event: Event) => void) | undefined>;

export const $ = (id: string): HTMLElement => document.getElementById(id)!;

/** Creates an element. Functions are listeners (`onclick`), booleans are flags (`hidden`), string children are text. */
export function make<K extends keyof HTMLElementTagNameMap>(tag: K, more: More = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(more)) {
    if (typeof value === "function") node.addEventListener(key.slice(2), value);
    else if (value === true) node.setAttribute(key, "");
    else if (value !== false && value !== undefined) node.setAttribute(key, String(value));
  }
  node.append(...children);
  return node;
}

/** A name with line break opportunities after each word: `magnet_driver`, `YawPitchBracket`. */
export function breakable(name: string): Child[] {
  const words = name.replace(/_|[a-z](?=[A-Z])/g, "$&\n").split("\n"); // some browsers do not support lookbehind
  return words.flatMap((word, k) => (k === 0 ? [word] : [make("wbr"), word]));
}

/** A radio group of buttons; the returned function reads `chosen` again and updates the buttons. */
export function choices(
  parent: HTMLElement, words: readonly string[], chosen: () => string | null, choose: (word: string) => void,
): () => void {
  const buttons = words.map((word) => make("button", { type: "button", role: "radio", title: word, onclick: () => choose(word) }, word));
  parent.replaceChildren(...buttons);
  parent.onkeydown = (event) => {
    const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (by === undefined || words.length === 0) return;
    event.preventDefault();
    event.stopPropagation();
    const next = (words.indexOf(chosen() ?? "") + by + words.length) % words.length;
    choose(words[next]);
    buttons[next].focus();
  };
  const update = (): void => {
    const own = chosen();
    buttons.forEach((button, index) => {
      button.setAttribute("aria-checked", String(words[index] === own));
      button.tabIndex = words[index] === own || (own === null && index === 0) ? 0 : -1;
    });
  };
  update();
  return update;
}

/** Fades the ends of a row that can be scrolled sideways; the returned function scrolls to the checked item. */
export function fading(row: HTMLElement): () => void {
  const update = (): void => {
    const { scrollLeft, clientWidth, scrollWidth } = row;
    row.classList.toggle("before", scrollLeft > 1);
    row.classList.toggle("after", scrollLeft + clientWidth < scrollWidth - 1);
  };
  row.addEventListener("scroll", update, { passive: true });
  new ResizeObserver(update).observe(row);
  return () => {
    row.querySelector('[aria-checked="true"], [aria-selected="true"]')?.scrollIntoView({ block: "nearest", inline: "nearest" });
    update();
  };
}

export function select(label: string, words: readonly string[], chosen: string, choose: (word: string) => void): HTMLLabelElement {
  const own = make("select", { "aria-label": label, onchange: (event) => choose((event.target as HTMLSelectElement).value) });
  own.append(...words.map((word) => make("option", { value: word, selected: word === chosen }, word)));
  return make("label", { class: "row" }, `${label} `, own);
}

export function pairs(rows: [string, Child | null][]): HTMLDListElement {
  const list = make("dl");
  for (const [name, value] of rows) if (value !== null && value !== "") list.append(make("dt", {}, name), make("dd", {}, value));
  return list;
}
