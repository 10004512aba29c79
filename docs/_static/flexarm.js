/* What the site's widgets share: elements, colours of the theme, scripts with data. */
"use strict";
window.flexarm = (() => {
  /** Make an element; `on...` attributes are listeners, null ones are left out. */
  function element(tag, attributes = {}, ...children) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
      else if (value !== null && value !== false) made.setAttribute(name, value === true ? "" : value);
    }
    made.append(...children);
    return made;
  }

  /** Make a group of radio buttons that looks like one switch. */
  function choices(legend, name, values, chosen, change) {
    const options = values.map(([value, text]) => {
      const input = element("input", { type: "radio", name, value, checked: value === chosen });
      input.addEventListener("change", () => change(value));
      return element("label", {}, input, element("span", {}, text));
    });
    return element("fieldset", { class: "fx-choices" }, element("legend", {}, legend), ...options);
  }

  /** Make a labelled list to choose from. */
  function list(text, values, chosen, change) {
    const options = values.map(([value, label]) => element("option", { value, selected: value === chosen }, label));
    const select = element("select", {}, ...options);
    select.addEventListener("change", () => change(select.value));
    return element("label", { class: "fx-list" }, element("span", {}, text), select);
  }

  /** Let a name break after its underlines, where there is little room. */
  const breakable = (name) => name.replaceAll("_", "_\u200b");

  /** Return a function that reads colours of the theme from a node. */
  function colours(node) {
    const style = getComputedStyle(node);
    return (name) => style.getPropertyValue(`--fx-${name}`).trim();
  }

  /** Call a function when the theme changes: by the reader's system or by the site's switch. */
  function onTheme(changed) {
    new MutationObserver(changed).observe(document.body, { attributeFilter: ["data-theme"] });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", changed);
  }

  /** Fit a canvas to the place that it has; return its drawing context, in CSS pixels, and its size. */
  function fitted(canvas) {
    const { clientWidth: width, clientHeight: height } = canvas;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    return { context, width, height };
  }

  /** Load a script with data; a page on a disk may load scripts, but no other files. */
  function load(source) {
    return new Promise((done, failed) => {
      const refuse = () => failed(new Error(`${source} cannot be loaded`));
      document.head.append(element("script", { src: source, onload: done, onerror: refuse }));
    });
  }

  /** Run a function once the page and its deferred scripts, which may hold data, are there. */
  function ready(run) {
    if (document.readyState === "complete") run();
    else document.addEventListener("DOMContentLoaded", run, { once: true });
  }

  // Who wants no motion gets pictures that move by a still one; a click on it shows the motion.
  ready(() => {
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) return;
    for (const picture of document.querySelectorAll('img[src$=".webp"], img[src$=".gif"]')) {
      const freeze = () => {
        const still = element("canvas", { class: "fx-still", role: "img", "aria-label": picture.alt, tabindex: 0 });
        [still.width, still.height] = [picture.naturalWidth, picture.naturalHeight];
        still.getContext("2d").drawImage(picture, 0, 0);
        still.title = "Show the motion";
        const show = () => still.replaceWith(picture);
        still.addEventListener("click", show);
        still.addEventListener("keydown", (event) => event.key === "Enter" && show());
        picture.replaceWith(still);
      };
      if (picture.complete) freeze();
      else picture.addEventListener("load", freeze, { once: true });
    }
  });

  // A button copies a page's code, not what it prints: of a session with Python what follows its prompts, else all.
  ready(() => {
    for (const box of document.querySelectorAll("div.highlight")) {
      if (box.closest(".cell_output, .highlight-text, .highlight-none") || !navigator.clipboard) continue;
      const button = element("button", { type: "button", class: "fx-copy", "aria-label": "Copy this code" }, "Copy");
      button.addEventListener("click", async () => {
        const lines = box.querySelector("pre").textContent.trimEnd().split("\n");
        const typed = lines.filter((line) => /^(>>>|\.\.\.)( |$)/.test(line)).map((line) => line.slice(4));
        await navigator.clipboard.writeText((typed.length ? typed : lines).join("\n"));
        button.textContent = "Copied";
        setTimeout(() => { button.textContent = "Copy"; }, 1500);
      });
      box.append(button);
    }
  });

  // What is wider than the page fades at the side where more is to be seen, and scrolls by the keyboard.
  const cues = new ResizeObserver((seen) => seen.forEach(({ target }) => cue(target)));
  function cue(box) {
    const hidden = box.scrollWidth - box.clientWidth;
    box.classList.toggle("fx-more-left", box.scrollLeft > 1);
    box.classList.toggle("fx-more-right", box.scrollLeft < hidden - 1);
    if (hidden > 1) box.tabIndex = 0;
  }
  function cued(box) {
    box.addEventListener("scroll", () => cue(box), { passive: true });
    cues.observe(box);
  }
  ready(() => document.querySelectorAll(".table-wrapper, .formula").forEach(cued));

  // A page on a disk may not fetch others: search there lists what it finds without the words around it.
  if (location.protocol === "file:") DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;

  return { element, choices, list, breakable, colours, onTheme, fitted, load, ready, cued };
})();
