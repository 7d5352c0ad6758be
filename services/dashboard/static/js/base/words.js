// The words of the page in the reader's language. English is in the code; other languages are catalogues of it.

const LANGUAGES = { en: "English", de: "Deutsch" };
const wanted = new URLSearchParams(location.search).get("lang") ?? localStorage.getItem("lang") ?? navigator.language.slice(0, 2);

export const language = wanted in LANGUAGES ? wanted : "en";

const catalogue = language === "en" ? {} : (await import(`../words/${language}.js`)).default;
document.documentElement.lang = language;

/** A text of the page; `{name}` in it stands for a value. */
export const t = (text, values = {}) => (catalogue[text] ?? text).replace(/\{(\w+)\}/g, (whole, name) => values[name] ?? whole);

/** Texts of the shell, which come with the page. */
export function translateShell() {
  for (const node of document.querySelectorAll("[data-t]")) node.textContent = t(node.textContent);
  for (const node of document.querySelectorAll("[data-t-label]")) node.ariaLabel = t(node.ariaLabel);
}

export function startLanguage() {
  const select = document.getElementById("language");
  for (const [name, word] of Object.entries(LANGUAGES)) select.append(new Option(word, name, false, name === language));
  select.addEventListener("change", () => {
    localStorage.setItem("lang", select.value);
    const address = new URL(location.href);
    address.searchParams.delete("lang");
    location.assign(address);
  });
}
