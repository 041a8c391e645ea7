"""Writes wide.xlsx: the readings of positioning.csv with a column for each pass, as reports of ISO 230-2 print them.

An xlsx file is a ZIP of XML (ECMA-376); this is the least that programs read. Run in this folder: python3 wide_xlsx.py
"""

import zipfile

rows = []
with open("positioning.csv", encoding="utf-8") as table:
    for line in table:
        cells = line.strip().split(";")
        if line.startswith("#") or cells[0] == "run":
            continue
        number = lambda cell: float(cell.replace(",", "."))
        rows.append((int(cells[0]), cells[1] == "up", number(cells[2]), number(cells[3])))

runs = sorted({row[0] for row in rows})
passes = [(run, up) for run in runs for up in (True, False)]
read = {(run, up, target): deviation for run, up, target, deviation in rows}
targets = sorted({row[2] for row in rows})

# Excel counts days from 1899-12-30: 2026-01-05 08:00:00.
DATE = 46027 + 8 / 24
sheet = {1: ["Positioning of X"], 2: ["Date", ("date", DATE)]}
sheet[4] = ["Position [mm]"] + [f"Run {run} {'↑' if up else '↓'}" for run, up in passes]
for k, target in enumerate(targets):
    sheet[5 + k] = [target] + [read[(run, up, target)] for run, up in passes]


def column(k):
    return chr(ord("A") + k)


def cell(at, value):
    if isinstance(value, tuple):
        return f'<c r="{at}" s="1"><v>{value[1]!r}</v></c>'
    if isinstance(value, str):
        return f'<c r="{at}" t="inlineStr"><is><t>{value}</t></is></c>'
    return f'<c r="{at}"><v>{value!r}</v></c>'


def worksheet(lines):
    body = "".join(
        f'<row r="{n}">' + "".join(cell(f"{column(k)}{n}", value) for k, value in enumerate(values)) + "</row>"
        for n, values in sorted(lines.items())
    )
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    return f'<?xml version="1.0" encoding="UTF-8"?><worksheet xmlns="{main}"><sheetData>{body}</sheetData></worksheet>'


HEAD = '<?xml version="1.0" encoding="UTF-8"?>'
MAIN = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = "http://schemas.openxmlformats.org/package/2006"
KIND = "application/vnd.openxmlformats-officedocument.spreadsheetml"
parts = {
    "[Content_Types].xml": f'{HEAD}<Types xmlns="{PACKAGE}/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="xml" ContentType="application/xml"/>'
    f'<Override PartName="/xl/workbook.xml" ContentType="{KIND}.sheet.main+xml"/>'
    f'<Override PartName="/xl/styles.xml" ContentType="{KIND}.styles+xml"/>'
    f'<Override PartName="/xl/worksheets/sheet1.xml" ContentType="{KIND}.worksheet+xml"/>'
    f'<Override PartName="/xl/worksheets/sheet2.xml" ContentType="{KIND}.worksheet+xml"/></Types>',
    "_rels/.rels": f'{HEAD}<Relationships xmlns="{PACKAGE}/relationships">'
    f'<Relationship Id="rId1" Type="{OFFICE}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
    "xl/workbook.xml": f'{HEAD}<workbook {MAIN} xmlns:r="{OFFICE}"><sheets>'
    '<sheet name="Empty" sheetId="1" r:id="rId1"/><sheet name="Laser" sheetId="2" r:id="rId2"/></sheets></workbook>',
    "xl/_rels/workbook.xml.rels": f'{HEAD}<Relationships xmlns="{PACKAGE}/relationships">'
    f'<Relationship Id="rId1" Type="{OFFICE}/worksheet" Target="worksheets/sheet1.xml"/>'
    f'<Relationship Id="rId2" Type="{OFFICE}/worksheet" Target="worksheets/sheet2.xml"/>'
    f'<Relationship Id="rId3" Type="{OFFICE}/styles" Target="styles.xml"/></Relationships>',
    "xl/styles.xml": f'{HEAD}<styleSheet {MAIN}><fonts count="1"><font/></fonts><fills count="1"><fill/></fills>'
    '<borders count="1"><border/></borders><cellStyleXfs count="1"><xf/></cellStyleXfs>'
    '<cellXfs count="2"><xf numFmtId="0"/><xf numFmtId="22" applyNumberFormat="1"/></cellXfs></styleSheet>',
    "xl/worksheets/sheet1.xml": worksheet({}),
    "xl/worksheets/sheet2.xml": worksheet(sheet),
}
with zipfile.ZipFile("wide.xlsx", "w", zipfile.ZIP_DEFLATED) as book:
    for name, text in parts.items():
        # Always the same bytes.
        info = zipfile.ZipInfo(name, (2026, 1, 5, 8, 0, 0))
        info.compress_type = zipfile.ZIP_DEFLATED
        book.writestr(info, text)
