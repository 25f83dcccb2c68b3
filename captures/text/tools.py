"""What tools and people write in logs: direction marks in any line, and the layouts of tools' own lines, declared.

A word (`TX`, `Sent`, `Request`) is a mark wherever it stands, an arrow only before the line's first bytes: between two
runs of bytes it joins a request with its answer. A colon right after a word is the word's, not the start of an ASCII
frame. What sent and received mean for the bus is not decided here.

A layout is an entry of `SHAPES`; its pattern has named groups for what it knows: `time`, `mark`, `hex`, `length` (bytes
that there should be), `sample` (number of the last sample) and `cut` (the tool's sign that it shows only some of them).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum, auto
from operator import itemgetter
from typing import Final, NamedTuple

NONE, TX, RX = 0, 1, 2

_WORDS: Final = {
    TX: "tx txd snd xmit send sends sending sent transmit transmitted transmitting request requests requested "
    "requesting req query outgoing wrote written writing "
    "запрос отправка отправлено отправлен отправил отправляю отправляем отправляет послал посылаем посылает "
    "посылаю передал передаю передаём передаем передаёт передает шлю шлёт шлет спрашиваю спрашивает "
    "передача передано посылка послано запит надіслано "
    "schicke schickt envoie invia wysyła envia "
    "gesendet senden sende gesendete anfrage abfrage envoi envoyé envoyée envoyer requête demande émission émis trame "
    "enviado enviada envío enviando enviar solicitud petición consulta envio requisição pedido pergunta solicitação "
    "inviato inviata invio inviati richiesta wysłano wysłane wysyłam zapytanie żądanie nadano "
    "gönderilen gönderildi gönder istek sorgu odesláno dotaz verzonden verzoek skickat",
    RX: "rx rxd recv rcv rcvd rsp receive receives receiving received response resp responds responded responding "
    "reply replies replied replying answer answers answered answering incoming got returns returned "
    "ответ приём прием принят принято принял принимаю получено получен получил получаю получили приходит пришло "
    "отвечает ответил ответила ответило присылает прислал возвращает вернул вернула отдаёт отдает "
    "відповідь отримано "
    "bekomme erhalte erhalten antwortet répond recibo responde ricevo risponde odpowiada "
    "empfangen empfang empfangene antwort reçu reçue réception recevoir réponse "
    "recibido recibida recibiendo recepción respuesta recebido recebida recepção resposta "
    "ricevuto ricevuta ricezione risposta odebrano otrzymano odbiór odpowiedź "
    "alınan alındı gelen yanıt cevap přijato odpověď ontvangen antwoord mottaget svar",
}
_MARK_OF: Final = {word: mark for mark, words in _WORDS.items() for word in words.split()}
_SIGNED: Final = {  # too common as words: marks only with a sign behind
    "out": TX, "master": TX, "client": TX, "write": TX, "мастер": TX, "ведущий": TX,
    "in": RX, "slave": RX, "server": RX, "read": RX, "слейв": RX, "ведомый": RX,
}  # fmt: skip
_SPEAKERS: Final = {  # marks only before an arrow
    "master": TX, "client": TX, "host": TX, "m": TX, "мастер": TX, "ведущий": TX,
    "plc": TX, "hmi": TX, "scada": TX, "pc": TX, "gateway": TX, "плк": TX, "панель": TX, "пк": TX,
    "drive": RX, "meter": RX, "rtu": RX, "sensor": RX, "inverter": RX, "vfd": RX, "счётчик": RX, "счетчик": RX,
    "slave": RX, "server": RX, "device": RX, "s": RX, "слейв": RX, "ведомый": RX, "прибор": RX, "устройство": RX,
}  # fmt: skip
_EAST: Final = {  # parts of words in scripts that put no spaces between them; the last one in a word counts
    TX: "发送 發送 发出 下发 请求 查询 询问 问询 主机 主站 上位机 送信 要求 전송 송신 요청 发",
    RX: "接收 收到 应答 應答 响应 响應 回复 回應 返回 从机 从站 下位机 受信 応答 수신 응답 收",
}
_PART_OF: Final = {part: mark for mark, parts in _EAST.items() for part in parts.split()}
_ARROW_OF: Final = {">": TX, "→": TX, "⇒": TX, "▶": TX, "<": RX, "←": RX, "⇐": RX, "◀": RX}
_CANDIDATE: Final = re.compile(
    r"(?<![^\W_])(?P<word>[^\W\d_]{1,16})(?![^\W\d_])"
    r"(?P<sign>\s*[:\]>|)](?!\s*(?:0x)?\d+\s*(?:[,;)\]/]|$))|\s+\d+\s*(?:$|[Bb]ytes?\b)|"
    r"(?=\s+(?:(?:[0-9A-F]{2} ){2}[0-9A-F]{2}|(?:(?:0[xX]|16#|\$)[0-9A-Fa-f]{1,2}[ ,]{1,2}){3}|<Buffer |to\s)))?|"
    r"(?P<arrow>-{1,3}>|=+>|>{2,3}|<-{1,3}|<=+|<{2,3}|[→⇒▶←⇐◀]|^\s*(?:>\s+)?(?!<\s+>)[<>](?=\s))"  # a quoted line's
)
_NAME: Final = r"(?![0-9A-Fa-f]{2}(?!\w))[^\W\d_][^\W_]{0,15}"
_NAMES: Final = re.compile(  # `Master -> Slave`: who says it to whom
    rf"(?<![^\W_])(?P<one>{_NAME})\s?(?P<way>-{{1,2}}>|=>|→|<-{{1,2}}|<=|←)\s?(?P<other>{_NAME})(?![^\W_])"
    r"(?P<bytes>(?=[\s:|=\])]{1,4}[\[(<'\"]?(?:0x)?[0-9A-Fa-f]{2}))?"
)
_SPEAKS: Final = re.compile(  # `Device --> 01 03`, `Slave <- 01 03`: whose bytes, or to whom
    r"(?<![^\W_])(?P<who>[^\W\d_]{4,16})\s{0,3}(?P<way>-{1,3}>|=+>|→|<-{1,3}|<=+|←)(?=\s{0,4}[\[(<'\"]?(?:0x)?[0-9A-Fa-f]{2})"
)
_CARRIER: Final = "(?:buf(?:fer)?|data|msg|message|frame|packet|bytes|telegram|pdu|adu)"
_CARRIED: Final = re.compile(rf"(?P<way>[a-z]{{2,8}}?){_CARRIER}|{_CARRIER}(?P<done>[a-z]{{2,8}})")  # `SendBuffer`
_NEGATED: Final = re.compile(
    r"(?:\b(?:no|not|never|without)|n['’]t|(?<!\w)(?:не|нет|без)) (?:\w{1,10} )?$|[无無未没]$", re.IGNORECASE
)
_NEGATED_WITHIN: Final = 24  # characters
_CODE: Final = 3  # characters of `TX`, `RXD`, before which `No` is a column's name
_NAMED: Final = re.compile("地址|编号|号|名称|数量|个数|番号|アドレス|주소|번호")  # a station's, and no message
_LETTERS: Final = re.compile(rf"[a-z]{{2,8}}?(?={_CARRIER}(?![^\W\d_]))|[^\W\d_]+")
_ASCII_WORD: Final = re.compile(rf"[a-z]{{2,8}}?(?={_CARRIER}(?![a-z]))|{_CARRIER}|[a-z]+")
_ARROW: Final = re.compile(r"->|=>|>>|<-|<=|<<|^\s*[<>]\s")
_OTHER: Final = {NONE: NONE, TX: RX, RX: TX}
_MARKING: Final = frozenset((*_MARK_OF, *_SIGNED))


class LineMark(NamedTuple):
    """A mark's extent in its line, and what it says; a plain word outweighs an arrow or the name of who speaks."""

    start: int
    end: int
    mark: int
    arrow: bool = False
    plain: bool = False


def marks(text: str) -> list[LineMark]:
    """The marks of a line, in order."""
    if text.isascii() and _MARKING.isdisjoint(_ASCII_WORD.findall(text.lower())) and not _ARROW.search(text):
        return []  # in most lines of most logs
    first = _named_speakers(text) or _speaker(text)
    line_marks = [first] if first is not None and first.mark else []
    for match in _CANDIDATE.finditer(text, 0 if first is None else first.end):
        mark = _arrow(match) if match["word"] is None else _word(text, match)
        if mark is not None:
            line_marks.append(mark)
    return line_marks


def _named_speakers(text: str) -> LineMark | None:
    """Who says it to whom, by their names; of no direction where nothing tells which of the two is which."""
    names = _NAMES.search(text)
    if names is None or _MARK_OF.get(names["one"].lower()):
        return None
    sender, addressee = names["one"], names["other"]
    if names["way"][0] in "<←":
        sender, addressee = addressee, sender
    kind = _of_speaker(sender) or _OTHER[_of_speaker(addressee)]
    if not kind and names["bytes"] is not None:  # names of plants: which of the two it is tells apart
        kind = TX if sender < addressee else RX
    return LineMark(*names.span(), kind)


def _speaker(text: str) -> LineMark | None:
    """Whose bytes they are, or to whom they go."""
    speaks = _SPEAKS.search(text)
    if speaks is None or not (kind := _SPEAKERS.get(speaks["who"].lower(), NONE)):
        return None
    return LineMark(*speaks.span(), _OTHER[kind] if speaks["way"][0] in "<←" else kind)


def _arrow(match: re.Match[str]) -> LineMark:
    arrow = match["arrow"].split()[-1]
    kind = _ARROW_OF[arrow[0] if arrow[0] in _ARROW_OF else arrow[-1]]
    return LineMark(match.start(), match.end(), kind, arrow=True)


def _word(text: str, match: re.Match[str]) -> LineMark | None:
    """A word that is a mark; `no response`, behind which the next request may stand, and `slave 12` are none."""
    (start, end), plain = match.span("word"), match["word"].lower()
    signed = match["sign"] is not None and not (plain in _SPEAKERS and match["sign"].strip().isdigit())
    kind = _of_word(plain, signed=signed or _is_method(text, start, end))
    if not kind or (len(plain) > _CODE and _NEGATED.search(text[max(start - _NEGATED_WITHIN, 0) : start])):
        return None
    return LineMark(start, end + text.startswith(":", end), kind, plain=plain not in _SIGNED)


def _is_method(text: str, start: int, end: int) -> bool:
    """`port.write(`"""
    return text[start - 1 : start] == "." and text[end : end + 1] == "("


def _of_word(word: str, *, signed: bool) -> int:
    """What a word in small letters says."""
    kind = _MARK_OF.get(word, NONE) or (_SIGNED.get(word, NONE) if signed else NONE)
    if kind:
        return kind
    if word.isascii():
        carried = _CARRIED.fullmatch(word)
        return NONE if carried is None else _of_word(carried["way"] or carried["done"], signed=signed)
    parts = ((word.rfind(part), len(part), mark) for part, mark in _PART_OF.items())
    found = [(at, mark) for at, size, mark in parts if at >= 0 and _NAMED.match(word, at + size) is None]
    return max(found, key=itemgetter(0), default=(0, NONE))[1]


def _of_speaker(word: str) -> int:
    return _of_word(word.lower(), signed=True) or _SPEAKERS.get(word.lower().rstrip("0123456789"), NONE)


def is_mark(word: str) -> bool:
    """Whether a word in small letters may be a direction mark."""
    return word in _MARKING or (not word.isascii() and _of_word(word, signed=True) != NONE)


def names_a_way(text: str) -> bool:
    """Whether a text in small letters has a word that may be a direction mark."""
    return any(map(is_mark, _LETTERS.findall(text)))


def either_way(text: str) -> str:
    """A text in small letters as it is whoever speaks: `sent` and `received`, `txBuf` and `rxBuf` are the same."""
    if not names_a_way(text):
        return text
    return _LETTERS.sub(lambda match: "tx" if is_mark(match[0]) else match[0], text)


class LineRole(Enum):
    """What a line of a tool's own layout is."""

    BYTES = auto()
    STRING = auto()  # bytes as a C string
    HEADER = auto()  # time, mark or label of the lines below
    NOTHING = auto()  # the tool's other lines, which carry no bytes


@dataclass(frozen=True, slots=True)
class Shape:
    """The layout of one tool's line; `mark` for a layout that is a direction by itself."""

    tool: str
    role: LineRole
    pattern: re.Pattern[str]
    mark: int = NONE


MARK_WORDS: Final = {  # of tools' own layouts
    **_MARK_OF, **_SIGNED, ">": TX, "irp_mj_write": TX, "s bo": TX, "<": RX, "irp_mj_read": RX, "c bi": RX,
    "processing": RX, "handling data": RX, "unexpected data": RX,
}  # fmt: skip
_STRACE = r"^(?:\[pid +\d+\] |\d+ +)?(?:(?P<time>\d\d:\d\d:\d\d(?:\.\d+)?|\d{9,10}\.\d+) )?"

_LAYOUTS: Final = (
    ("socat -x", LineRole.HEADER, NONE,
     r"^(?P<mark>[<>]) (?P<time>\d{4}/\d\d/\d\d \d\d:\d\d:\d\d\.\d+) +length=(?P<length>\d+) from=\d+ to=\d+\s*$"),
    ("strace", LineRole.STRING, NONE,
     _STRACE + r"(?:<\.\.\. )?(?P<mark>read|write)(?: resumed>|\((?![12]\b)\d+(?:<[^>]*>)?, )"
            r'"(?P<hex>(?:[^"\\]|\\.)*)"(?P<cut>\.\.\.)?, \d+\)\s+= (?P<length>-?\d+)'),
    ("strace", LineRole.NOTHING, NONE,
     _STRACE + r"(?:\w+\(.*(?:\)\s+= (?:-?\d|0x|\?)|<unfinished)|<\.\.\. \w+ resumed|"
            r"(?:\+{3}|-{3}) (?:exited|killed|SIG))"),
    ("pymodbus", LineRole.BYTES, NONE,
     r"(?i)^(?=.*[a-z](?:: | - ))(?P<time>\d{4}-\d\d-\d\d \d\d:\d\d:\d\d[,.]\d{3})?"
            r"(?:(?!(?:send|recv): 0x| 0x[0-9a-f]{1,2} 0x).)*\b"
            r"(?P<mark>send|recv|processing|handling data|unexpected data|getting frame|short frame|"
            r"current frame in buffer)(?:: | - )"
            r"(?P<hex>(?:0x[0-9a-f]{1,2}(?: |$))*)\s*"
            r"(?:(?:extra data|unexpected data|old_data):.*|wait for more data)?$"),
    ("pymodbus", LineRole.NOTHING, NONE,
     r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d[,.]\d{3} [A-Z]+ +\w+:\d+ "),
    ("Saleae Logic 2, as characters", LineRole.STRING, NONE,
     r'^"[^"]*","data",(?P<time>\d+\.\d+),[^,"]*,"(?P<hex>[^"\\]|\\x[0-9A-Fa-f]{2}|\\[0abtnvfr\\])"(?:,|\s*$)'),
    ("PowerShell", LineRole.NOTHING, NONE,
     r"^\s+(?:Label: .* <[0-9A-F]{8}>|Path: .*)\s*$"),
    ("libmodbus", LineRole.BYTES, TX,
     r"^(?P<hex>(?:\[[0-9A-F]{2}\])+)\s*$"),
    ("libmodbus", LineRole.BYTES, RX,
     r"^(?P<hex>(?:<[0-9A-F]{2}>)+)\s*$"),
    ("libmodbus, mbpoll", LineRole.NOTHING, NONE,
     r"^(?:Waiting for an? (?:confirmation|indication)|Opening /|-- Polling|\[\d+\]:\s|Bytes flushed|"
            r"debug enabled|Set (?:mode|device|function|rtu|number|start|response|timeout|daddr)\b|iGet\w*List\(|"
            r"Integer found:|iCount=|\d+ bytes flushed|"
            r"ERROR |(?:Read|Write) .* failed:|mbpoll \d|Protocol configuration:|Slave configuration\.*:|"
            r"Communication\.+:|Data type\.+:|Written \d|Copyright |This program comes|"
            r"This is free software|to redistribute|under certain|\s+(?:address|start|baudrate|t/o)\b)"),
    ("ESPHome", LineRole.NOTHING, NONE,
     r"^(?:\[[\d:.]+\])?\[[A-Z]{1,2}\]\[[\w.]+:\d+\]:"),
    ("PortMon", LineRole.BYTES, NONE,
     r"^\d+(?=\s.*\bIRP_MJ_)\s{1,16}(?P<time>\d{1,2}:\d\d:\d\d(?:\.\d+)?(?: [AP]M)?|\d+\.\d+)?\s"
            r".*?\b(?P<mark>IRP_MJ_READ|IRP_MJ_WRITE)\s.*\bLength (?P<length>\d+): "
            r"(?P<hex>(?:[0-9A-Fa-f]{2}(?:\s|$))+)(?P<cut>\.\.\.)?\s*$"),
    ("serial port monitors, table", LineRole.BYTES, NONE,
     r"^\d+\t(?:(?P<time>[^\t]*\d:\d\d:\d\d[^\t]*)\t)?(?:[^\t]*\t){0,12}?(?P<mark>IRP_MJ_READ|IRP_MJ_WRITE)\t"
            r"(?:[^\t]*\t){0,12}?(?P<hex>[0-9A-Fa-f]{2}(?: [0-9A-Fa-f]{2})+) ?(?:\t|$)"),
    ("Eltima Serial Port Monitor", LineRole.HEADER, NONE,
     r"^\d+\s+(?P<mark>IRP_MJ_READ|IRP_MJ_WRITE) - Request transfers data\b"),
    ("Eltima Serial Port Monitor", LineRole.NOTHING, NONE,
     r"^\s+(?:STATUS_\w+|IOCTL_\w+ - .*|(?=[A-Za-z]*[g-zG-Z])[A-Za-z]+ - \w+)\s*$"),
    ("Device Monitoring Studio", LineRole.HEADER, NONE,
     r"^\d{6}: (?P<mark>Read|Write) Request \((?:UP|DOWN)\), (?P<time>\d[\d./-]+ \d\d:\d\d:\d\d\.\d+)"),
    ("Free Serial Analyzer", LineRole.HEADER, NONE,
     r"^\[(?P<time>\d[^\]]+)\] (?P<mark>Written|Read) data \(\S+\)\s*$"),
    ("usbmon", LineRole.BYTES, NONE,  # behind the two status bytes of an FTDI adapter, where it is one
     r"^[0-9a-f]{8,16} (?P<us>\d{1,16}) (?P<mark>[SCE] [CBIZ][io]):\d+:\d+:\d+ "
            r"(?:s .*|-?\d+(?: \d+(?: (?:[<>]|= (?:[0-3]160 ?)?))?)?)"
            r"(?P<hex>[0-9a-f ]*)$"),
    ("PortMon", LineRole.NOTHING, NONE,
     r"^\d+\s.*\b(?:IRP_MJ_(?!READ|WRITE)\w+|IOCTL_\w+|"
            r"IRP_MJ_(?:READ|WRITE)\b(?!.*\b[0-9A-Fa-f]{2} [0-9A-Fa-f]{2}\b))"),
    ("sigrok uart", LineRole.BYTES, NONE,
     r"(?i)^\d+-(?P<sample>\d+) (?:uart-\d+|UART(?:-\d+|\[\d+\])?): (?:(?P<mark>[RT]X)(?: data)?: )?"
            r"(?P<hex>[0-9A-F]{2})\s*$"),
    ("sigrok uart_packet", LineRole.BYTES, NONE,
     r"^uart_packet-\d+:\s+(?P<time>\d+\.\d{3}) (?P<mark>[RT]X): (?P<hex>[0-9A-F]{2}(?: [0-9A-F]{2})*)\s*$"),
)  # fmt: skip
SHAPES: Final = tuple(Shape(tool, role, re.compile(pattern), mark) for tool, role, mark, pattern in _LAYOUTS)
