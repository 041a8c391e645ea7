//! The table of a series as one page: a file that needs no other, with the protocol's targets and who was taken for
//! whom.

use crate::series::{folder, run};

/// What makes a browser fetch something.
const FETCHES: [&str; 7] = [
    "<script", "<link", "<img", "src=", "href=", "url(", "@import",
];
/// Names of XML's own that look like an address, and are none.
const NAMES: [&str; 2] = ["http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"];

/// What of a page is not in the page itself.
fn outside(page: &str) -> Vec<String> {
    let bare = NAMES
        .iter()
        .fold(page.to_owned(), |page, name| page.replace(name, ""));
    let all = FETCHES.iter().copied().chain(["://"]);
    let found = all.filter(|mark| bare.contains(mark));
    found.map(str::to_owned).collect()
}

/// Cells of the first row of the table's body that begins with `head`, without their tags.
fn row(page: &str, head: &str) -> Vec<String> {
    let start = page
        .find(&format!(">{head}"))
        .unwrap_or_else(|| panic!("{head}:\n{page}"));
    let whole = page[start + 1..].split("</tr>").next().unwrap();
    let bare = |cell: &str| {
        let parts = cell.split('<');
        let texts = parts.map(|part| part.split_once('>').map_or(part, |(_, text)| text));
        texts.collect::<Vec<_>>().join(" ").trim().to_owned()
    };
    let cells = whole.split("</td>").flat_map(|cell| cell.split("</th>"));
    cells.map(bare).collect()
}

#[test]
fn the_page_of_a_series_is_one_file_with_its_targets_and_its_matrix() {
    let folder = folder();
    let (page, markdown) = (folder.path().join("p.html"), folder.path().join("p.md"));
    let arguments = [
        "--arm",
        "alone",
        "--n",
        "2",
        "--seed",
        "11",
        "--in-process",
        "--baselines",
        "--html",
        page.to_str().unwrap(),
        "--markdown",
        markdown.to_str().unwrap(),
    ];
    let (table, said) = run(folder.path(), &arguments);
    let page = std::fs::read_to_string(page).unwrap();
    assert_eq!(outside(&page), Vec::<String>::new());
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>"));
    for target in table["targets"].as_array().unwrap() {
        let cells = row(&page, &escaped(target["metric"].as_str().unwrap()));
        assert_eq!(cells[1], escaped(target["wanted"].as_str().unwrap()));
    }
    let confusion = table["arms"][0]["confusion"].as_array().unwrap();
    assert!(!confusion.is_empty(), "{said}");
    let markdown = std::fs::read_to_string(markdown).unwrap();
    assert!(markdown.contains("| hidden | said | observed k/n | predicted cosine |"));
    for pair in confusion {
        let (hidden, said) = (&pair["hidden"], pair["said"].as_str().unwrap());
        let count = &pair["observed"];
        let line = format!(
            "| {} | {said} | {}/{} | ",
            hidden.as_str().unwrap(),
            count["k"],
            count["n"]
        );
        assert!(markdown.contains(&line), "{line}\n{markdown}");
        in_matrix(&page, pair);
    }
}

/// A pair has its cell in the row of what was hidden and the column of what was said.
fn in_matrix(page: &str, pair: &serde_json::Value) {
    let matrix = page.split("<table class=\"confusion\"").nth(1).unwrap();
    let head = row(matrix, "hidden, trials");
    let said = pair["said"].as_str().unwrap();
    let column = said.trim_matches(['(', ')']);
    let place = head.iter().position(|cell| cell == column).unwrap();
    let hidden = pair["hidden"].as_str().unwrap();
    let cells = row(matrix, &format!("{hidden}, {}</th>", pair["observed"]["n"]));
    let cell = &cells[place];
    if let Some(cosine) = pair["cosine"].as_f64() {
        assert!(cell.contains(&format!("{cosine:.2}")), "{said}: {cells:?}");
    }
    let k = pair["observed"]["k"].as_u64().unwrap();
    let count = if said == column {
        k.to_string()
    } else {
        format!("({k})")
    };
    assert!(k == 0 || cell.contains(&count), "{said}: {cells:?}");
}

fn escaped(text: &str) -> String {
    text.replace('>', "&gt;").replace('<', "&lt;")
}

#[test]
fn what_a_page_takes_from_elsewhere_is_noticed() {
    for one in [
        "<img data-x>",
        "<p style=\"background: url(x.png)\">",
        "<a href=\"other.html\">",
        "<p>https://a.example</p>",
    ] {
        assert!(!outside(one).is_empty(), "{one}");
    }
    let drawing = "<svg xmlns=\"http://www.w3.org/2000/svg\"></svg>";
    assert_eq!(outside(drawing), Vec::<String>::new());
}
