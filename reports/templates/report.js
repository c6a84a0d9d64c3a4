"use strict";
// Comfort for readers with a script: tables sort by their columns, sections fold, headings explain themselves.
(() => {
  const make = (tag, properties) => Object.assign(document.createElement(tag), properties);

  // A number with its sign, unit and bound: "−1.50 mm", "<0.0001", "∞"; NaN for text.
  const numberIn = (text) => {
    const plain = text.replace("−", "-").replace("∞", "Infinity").replace(/^[<>≤≥±]\s*/, "");
    const found = /^[-+]?(Infinity|\d[\d.]*(e[-+]?\d+)?)(?=$|[\s%°])/i.exec(plain);
    return found ? Number(found[0]) : NaN;
  };
  const compareCells = (a, b) => {
    const [x, y] = [numberIn(a), numberIn(b)];
    if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1;
    return Number.isNaN(x) ? a.localeCompare(b, undefined, { numeric: true }) : x - y;
  };
  const textOf = (row, column) => row.cells[column].textContent.trim();

  // Rows keep to their group; empty cells come last in both directions.
  const sortGroup = (group, column, direction) => {
    const rows = [...group.rows].filter((row) => row.dataset.place);
    rows.sort((a, b) => {
      const place = Number(a.dataset.place) - Number(b.dataset.place);
      if (direction === 0) return place;
      const [x, y] = [textOf(a, column), textOf(b, column)];
      if (!x || !y) return (x ? 0 : 1) - (y ? 0 : 1) || place;
      return direction * compareCells(x, y) || place;
    });
    rows.forEach((row) => group.append(row));
  };

  const DIRECTIONS = { none: "ascending", ascending: "descending", descending: "none" };
  const SIGNS = { ascending: 1, descending: -1, none: 0 };
  const sortable = (table) => {
    const heads = [...table.tHead.rows[table.tHead.rows.length - 1].cells];
    for (const group of table.tBodies) {
      [...group.rows].forEach((row, place) => {
        if (row.cells.length === heads.length) row.dataset.place = String(place + 1);
      });
    }
    if (table.querySelectorAll("tr[data-place]").length < 2) return;
    heads.forEach((head, column) => {
      const button = make("button", { type: "button", className: "sort" });
      button.append(...head.childNodes);
      head.append(button);
      head.setAttribute("aria-sort", "none");
      button.addEventListener("click", () => {
        const next = DIRECTIONS[head.getAttribute("aria-sort")];
        heads.forEach((other) => other.setAttribute("aria-sort", "none"));
        head.setAttribute("aria-sort", next);
        for (const group of table.tBodies) sortGroup(group, column, SIGNS[next]);
      });
    });
  };

  const foldable = (section) => {
    const title = section.querySelector("h2");
    const button = make("button", { type: "button", className: "fold" });
    const content = make("div", { id: `${section.id}-content` });
    button.append(...title.childNodes);
    content.append(...[...section.childNodes].filter((node) => node !== title));
    section.append(content);
    title.append(button);
    button.setAttribute("aria-controls", content.id);
    const show = (open) => {
      content.hidden = !open;
      button.setAttribute("aria-expanded", String(open));
    };
    button.addEventListener("click", () => show(content.hidden));
    section.addEventListener("unfold", () => show(true));
    show(true);
  };

  // The page of links leads into what is folded, and paper has no buttons.
  const unfold = (element) => {
    for (let at = element; at; at = at.parentElement) {
      if (at.tagName === "DETAILS") at.open = true;
      at.dispatchEvent(new Event("unfold"));
    }
  };
  const unfoldTarget = () => {
    const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (target) {
      unfold(target);
      target.scrollIntoView();
    }
  };

  // Headings with a title: the browser shows it to a mouse only, this to the keyboard and to touch as well.
  const tip = make("div", { id: "tip", hidden: true });
  tip.setAttribute("role", "tooltip");
  const explain = (head) => {
    const text = head.title;
    const owner = head.querySelector("button") || head;
    head.removeAttribute("title");
    if (owner === head) head.tabIndex = 0;
    owner.setAttribute("aria-describedby", "tip");
    const show = () => {
      tip.textContent = text;
      tip.hidden = false;
      const at = head.getBoundingClientRect();
      const left = Math.min(at.left, document.documentElement.clientWidth - tip.offsetWidth - 8);
      tip.style.left = `${Math.max(8, left) + scrollX}px`;
      tip.style.top = `${at.bottom + scrollY + 4}px`;
    };
    const hide = () => { tip.hidden = true; };
    head.addEventListener("mouseenter", show);
    head.addEventListener("mouseleave", hide);
    owner.addEventListener("focus", show);
    owner.addEventListener("blur", hide);
  };

  document.addEventListener("DOMContentLoaded", () => {
    document.querySelectorAll("main table").forEach(sortable);
    document.querySelectorAll("main > section[id]").forEach(foldable);
    document.body.append(tip);
    document.querySelectorAll("th[title]").forEach(explain);
    document.addEventListener("keydown", (event) => { if (event.key === "Escape") tip.hidden = true; });
    addEventListener("hashchange", unfoldTarget);
    addEventListener("beforeprint", () => document.querySelectorAll("details, main > section").forEach(unfold));
    unfoldTarget();
  });
})();
