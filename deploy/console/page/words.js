// The page's words, one file a language. A key that is missing shows as itself, so that it is noticed.

const files = {};
export const LANGUAGES = ["en", "zh"];
let language = "en";

export async function load() {
  await Promise.all(LANGUAGES.map(async (each) => {
    files[each] = await (await fetch(`/page/${each}.json`)).json();
  }));
}

export function choose(next) {
  language = LANGUAGES.includes(next) ? next : "en";
  document.documentElement.lang = language === "zh" ? "zh-Hans" : language;
}

export const chosen = () => language;
export const other = () => LANGUAGES[(LANGUAGES.indexOf(language) + 1) % LANGUAGES.length];

/** The words of a key, its {places} filled. */
export function t(key, places = {}, which = language) {
  const words = files[which]?.[key] ?? key;
  return words.replace(/\{(\w+)\}/g, (whole, name) => String(places[name] ?? whole));
}

export const has = (key) => Boolean(files[language]?.[key]);

/** `left_elbow_pitch` in the reader's words; a part that has none stays as it is. */
export function nameOf(name) {
  const parts = name.split("_").map((part) => (has(`name.${part}`) ? t(`name.${part}`) : part));
  return parts.join(language === "zh" ? "" : " ");
}

/** Put the words into every element that names its key. */
export function translate(root = document) {
  for (const element of root.querySelectorAll("[data-t]")) element.textContent = t(element.dataset.t);
  for (const element of root.querySelectorAll("[data-label]")) {
    element.setAttribute("aria-label", t(element.dataset.label));
  }
}
