// The page: a text in, its frames out. Everything stays in this browser.

export const WORDS = {
  en: {
    about: "Modbus bytes, read in your browser. Nothing leaves this machine.",
    paste: "Paste bytes or lines of a log, or drop a file",
    frames: "Frames",
    file: "Open a file",
    example: "Example",
    link: "Copy a link to this paste",
    clear: "Clear",
    loading: "Loading the reader: {share} %",
    reading: "Reading …",
    took: "Read in {seconds} s",
    copied: "The link is copied. Who opens it sees this paste; it is in the link itself.",
    unlinked: "The link could not be copied. It stands in the address line.",
    failed: "The reader could not be loaded: {why}",
    large: "Over 8 MiB of text is no paste. The program reads captures of any size.",
  },
  ru: {
    about: "Байты Modbus, прочитанные в вашем браузере. Ничто не покидает этот компьютер.",
    paste: "Вставьте байты или строки журнала, или перетащите файл",
    frames: "Кадры",
    file: "Открыть файл",
    example: "Пример",
    link: "Скопировать ссылку на этот текст",
    clear: "Очистить",
    loading: "Загружается: {share} %",
    reading: "Читаю…",
    took: "Прочитано за {seconds} с",
    copied: "Ссылка скопирована. Кто её откроет, увидит этот текст: он в самой ссылке.",
    unlinked: "Скопировать ссылку не удалось. Она стоит в строке адреса.",
    failed: "Загрузить не удалось: {why}",
    large: "Больше 8 МиБ текста — это не вставка. Записи любого размера читает программа.",
  },
};
const EXAMPLE = "TX: 11 03 00 6B 00 03 76 87\nRX: 11 03 06 AE 41 56 52 43 40 49 AD\n";
const LONGEST = 8 << 20;
const PAUSE_MS = 150;

if (typeof document !== "undefined") start();

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
      const seconds = ((performance.now() - begun) / 1000).toFixed(2);
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
