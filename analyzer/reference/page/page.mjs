// The page: a text in, its frames out. Everything stays in this browser.

export const WORDS = {
  en: {
    about: "Reads Modbus bytes in your browser. Nothing leaves this machine.",
    paste: "Paste bytes or log lines, or drop a file",
    frames: "Frames",
    file: "Open a file",
    example: "Example",
    link: "Copy link",
    clear: "Clear",
    loading: "Loading: {share}%",
    reading: "Reading…",
    took: "Read in {seconds} s",
    copied: "Link copied. It contains this paste.",
    unlinked: "The link could not be copied. It is in the address bar.",
    failed: "Loading failed: {why}",
    large: "Over 8 MiB: too large for this page. The program reads captures of any size.",
  },
  ru: {
    about: "Читает байты Modbus в вашем браузере. Данные не покидают этот компьютер.",
    paste: "Байты, строки журнала или файл",
    frames: "Кадры",
    file: "Файл…",
    example: "Пример",
    link: "Скопировать ссылку",
    clear: "Очистить",
    loading: "Загружается: {share} %",
    reading: "Читаю…",
    took: "Прочитано за {seconds} с",
    copied: "Ссылка скопирована. В ней самой — этот текст.",
    unlinked: "Скопировать ссылку не удалось. Она в адресной строке.",
    failed: "Загрузить не удалось: {why}",
    large: "Больше 8 МиБ: для страницы это много. Программа читает записи любого размера.",
  },
};
const EXAMPLE = "TX: 11 03 00 6B 00 03 76 87\nRX: 11 03 06 AE 41 56 52 43 40 49 AD\n";
const LONGEST = 8 << 20;
const PAUSE_MS = 150;

if (typeof document !== "undefined") start();

// Colours lines of the frames, where the browser has highlights: what is wrong ("! ..."), and each frame's first line.
function colour(node) {
  if (!globalThis.Highlight) return;
  const ranges = { wrong: [], head: [] };
  for (const line of (node?.data ?? "").matchAll(/^\S.*$/gm)) {
    const range = new Range();
    range.setStart(node, line.index);
    range.setEnd(node, line.index + line[0].length);
    ranges[line[0].startsWith("!") ? "wrong" : "head"].push(range);
  }
  for (const name in ranges) CSS.highlights.set(name, new Highlight(...ranges[name]));
}

function start() {
  const at = (id) => document.getElementById(id);
  const paste = at("paste");
  const worker = new Worker(new URL("worker.mjs", import.meta.url), { type: "module" });
  let lang = navigator.language?.startsWith("ru") ? "ru" : "en";
  let number = 0;
  let begun = 0;
  let ready = false;
  let waiting;
  let bytes = null; // of a file that was opened, until the text is changed by hand

  const say = (name, places = {}) => WORDS[lang][name].replace(/\{(\w+)\}/g, (_, place) => places[place]);
  const state = (text, wrong = false) => {
    at("state").textContent = text;
    at("state").classList.toggle("wrong", wrong);
  };

  worker.onmessage = ({ data }) => {
    if (data.share !== undefined && !data.ready) state(say("loading", { share: Math.round(100 * data.share) }));
    else if (data.failed) state(say("failed", { why: data.failed }), true);
    else if (data.ready) {
      ready = true;
      state("");
      ask();
    } else if (data.number === number) {
      at("frames").textContent = data.text;
      colour(at("frames").firstChild);
      const seconds = ((performance.now() - begun) / 1000).toLocaleString(lang, { maximumFractionDigits: 1, minimumFractionDigits: 1 });
      state(data.complaint || say("took", { seconds }), Boolean(data.complaint));
    }
  };
  worker.onerror = (event) => state(say("failed", { why: event.message ?? "" }), true);

  function ask() {
    number += 1;
    if (!ready) return;
    if (!paste.value.trim() && !bytes) {
      at("frames").textContent = "";
      state("");
      return;
    }
    if ((bytes?.length ?? paste.value.length) > LONGEST) {
      state(say("large"), true);
      return;
    }
    begun = performance.now();
    state(say("reading"));
    worker.postMessage({ number, text: paste.value, bytes, lang });
  }

  function speak(language) {
    lang = language;
    document.documentElement.lang = lang;
    for (const each of document.querySelectorAll("[data-words]")) each.textContent = say(each.dataset.words);
    for (const each of ["en", "ru"]) at(each).setAttribute("aria-pressed", String(each === lang));
    ask();
  }

  function put(text) {
    bytes = null;
    paste.value = text;
    ask();
  }

  async function open(file) {
    if (!file) return;
    if (file.size > LONGEST) {
      state(say("large"), true);
      return;
    }
    const data = new Uint8Array(await file.arrayBuffer());
    put(new TextDecoder().decode(data));
    bytes = data;
    ask();
  }

  const linked = () => {
    const found = /^#paste=(.*)$/s.exec(location.hash);
    try {
      return found ? decodeURIComponent(found[1]) : "";
    } catch {
      return "";
    }
  };

  paste.addEventListener("input", () => {
    bytes = null;
    clearTimeout(waiting);
    waiting = setTimeout(ask, PAUSE_MS);
  });
  at("file").addEventListener("change", () => open(at("file").files[0]));
  at("example").addEventListener("click", () => put(EXAMPLE));
  at("clear").addEventListener("click", () => put(""));
  at("link").addEventListener("click", async () => {
    location.hash = `paste=${encodeURIComponent(paste.value)}`;
    try {
      await navigator.clipboard.writeText(location.href);
      state(say("copied"));
    } catch {
      state(say("unlinked"));
    }
  });
  for (const each of ["en", "ru"]) at(each).addEventListener("click", () => speak(each));
  addEventListener("hashchange", () => linked() && linked() !== paste.value && put(linked()));
  addEventListener("dragover", (event) => {
    event.preventDefault();
    document.body.classList.add("over");
  });
  addEventListener("dragleave", () => document.body.classList.remove("over"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("over");
    open(event.dataTransfer.files[0]);
  });

  paste.value = linked();
  speak(lang);
  state(say("loading", { share: 0 }));
}
