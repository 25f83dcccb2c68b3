// Reads pastes off the page's own thread, so that it stays alive while they are read.
import { load } from "./rtuscope.mjs";

const ready = load({ onProgress: (share) => postMessage({ share }) });
ready.then(
  () => postMessage({ ready: true }),
  (error) => postMessage({ failed: String(error) }),
);

onmessage = async ({ data: { number, text, bytes, lang } }) => {
  try {
    const reader = await ready;
    const shown = bytes ? reader.parseFile(bytes, lang) : reader.parse(text, lang);
    postMessage({ number, text: shown, complaint: reader.complaint });
  } catch (error) {
    postMessage({ number, text: "", complaint: String(error) });
  }
};
