// Compiles the archive's Python with Pyodide's own: node compile.mjs PYODIDE SOURCES COMPILED
import { readFileSync, writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [home, sources, compiled] = process.argv.slice(2);
const { loadPyodide } = await import(new URL("pyodide.mjs", pathToFileURL(`${home}/`)));
const pyodide = await loadPyodide({ indexURL: home });
pyodide.FS.mkdirTree("/rtuscope");
pyodide.unpackArchive(new Uint8Array(readFileSync(sources)), "zip", { extractDir: "/rtuscope" });
pyodide.runPython(`
import py_compile, zipfile
from pathlib import Path

unchecked = py_compile.PycInvalidationMode.UNCHECKED_HASH
with zipfile.ZipFile("/compiled.zip", "w") as packed:
    for path in sorted(Path("/rtuscope").rglob("*")):
        if path.is_dir():
            continue
        if path.suffix == ".py":
            path = Path(py_compile.compile(str(path), f"{path}c", doraise=True, invalidation_mode=unchecked))
        entry = zipfile.ZipInfo(str(path.relative_to("/rtuscope")), (1980, 1, 1, 0, 0, 0))
        packed.writestr(entry, path.read_bytes(), zipfile.ZIP_DEFLATED, 9)
`);
writeFileSync(compiled, pyodide.FS.readFile("/compiled.zip"));
