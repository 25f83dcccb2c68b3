// Pastes read by rtuscope on Pyodide, in a browser or in Node.
//
//     const reader = await load({ indexURL: "pyodide/" });
//     reader.parse("11 03 00 6B 00 03 76 87", "en");   // what `rtuscope parse -f -` prints
//     reader.complaint;                                 // why it is empty, where it is

const IN_NODE = typeof process !== "undefined" && Boolean(process.versions?.node);

async function absolute(place) {
  if (!IN_NODE) return new URL(place, import.meta.url).href;
  const { pathToFileURL } = await import("node:url");
  if (/^file:/.test(place)) return place;
  return /^(\/|[A-Za-z]:[\\/])/.test(place) ? pathToFileURL(place).href : new URL(place, import.meta.url).href;
}

async function bytesOf(url) {
  if (IN_NODE) {
    const { readFile } = await import("node:fs/promises");
    return new Uint8Array(await readFile(new URL(url)));
  }
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`${url}: ${answer.status}`);
  return new Uint8Array(await answer.arrayBuffer());
}

// indexURL: the folder in which Pyodide lies. onProgress: told a share from 0 to 1.
export async function load({ indexURL = "pyodide/", onProgress = () => {} } = {}) {
  const base = (await absolute(indexURL)).replace(/\/?$/, "/");
  onProgress(0.1);
  const archive = bytesOf(new URL("rtuscope.zip", import.meta.url).href);
  const { loadPyodide } = await import(`${base}pyodide.mjs`);
  const home = IN_NODE ? (await import("node:url")).fileURLToPath(base) : base;
  const pyodide = await loadPyodide({ indexURL: home });
  onProgress(0.6);
  pyodide.FS.mkdirTree("/rtuscope");
  pyodide.unpackArchive(await archive, "zip", { extractDir: "/rtuscope" });
  pyodide.runPython("import sys; sys.path.insert(0, '/rtuscope')");
  const reading = pyodide.pyimport("analyzer.reference.page.reading");
  onProgress(0.9);

  const reader = {
    complaint: "",
    parse: (text, lang = "en") => taken(reading.printed(text, lang)),
    parseFile(data, lang = "en") {
      const bytes = pyodide.toPy(data);
      try {
        return taken(reading.printed_file(bytes, lang));
      } finally {
        bytes.destroy();
      }
    },
  };
  function taken(printed) {
    const [text, complaint] = printed.toJs();
    printed.destroy();
    reader.complaint = complaint;
    return text;
  }
  reader.parse("TX: 11 03 00 6B 00 03 76 87\nRX: 11 83 02 C1 35\n"); // what a log needs is loaded now, not with the first paste
  onProgress(1);
  return reader;
}
