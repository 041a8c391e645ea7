//! A page of a diagnosis as a file that is opened anywhere: one file, and legible on a phone, on a desk and on paper.

use abbe_tests::chromium::{Browser, Layout, Picture};

/// A phone, a desk, and what is printed on of a sheet of A4 with margins of 10 mm; CSS px.
const PHONE_PX: u32 = 390;
const DESK_PX: u32 = 1280;
const SHEET_PX: u32 = 718;
/// Least share of a picture that is not paper.
const LEAST_INK: f64 = 0.01;

/// Values of the attributes, and arguments of `url(` and `@import`, that make a browser fetch something.
fn fetched(page: &str) -> Vec<String> {
    let mut found = vec![];
    let starts = ["src", "href", "srcset", "data", "action", "poster"];
    for name in starts {
        for (place, _) in page.match_indices(name) {
            let begins = page[..place].ends_with([' ', '\n', '\t', ':', '"', '\'']);
            let rest = page[place + name.len()..].trim_start();
            let Some(value) = rest.strip_prefix('=').filter(|_| begins) else {
                continue;
            };
            let value = value.trim_start().trim_start_matches(['"', '\'']);
            found.push(
                value
                    .split(['"', '\'', ' ', '>'])
                    .next()
                    .unwrap()
                    .to_owned(),
            );
        }
    }
    for (mark, ends) in [("url(", ')'), ("@import", ';')] {
        found.extend(page.split(mark).skip(1).map(|rest| {
            let value = rest.split(ends).next().unwrap();
            value.trim_matches([' ', '"', '\'']).to_owned()
        }));
    }
    // Places within the page, and what the page itself holds.
    found.retain(|value| !value.starts_with('#') && !value.starts_with("data:"));
    found
}

/// The page fetches nothing.
pub fn is_one_file(page: &str) {
    assert_eq!(fetched(page), Vec::<String>::new());
    assert!(!page.contains("<script") && !page.contains("<link"));
}

fn lies_within(layout: &Layout, width_px: u32, place: &str) {
    assert!(
        (layout.seen_px - f64::from(width_px)).abs() < 0.5,
        "{place}: {layout:?}"
    );
    assert!(layout.needed_px <= layout.seen_px, "{place}: {layout:?}");
    assert!(layout.beyond.is_empty(), "{place}: {layout:?}");
}

fn is_drawn(picture: &Picture, is_dark: bool) {
    let is_of_scheme = |c: &f64| if is_dark { *c < 64.0 } else { *c > 192.0 };
    assert!(picture.paper.iter().all(is_of_scheme), "{picture:?}");
    assert!(picture.inked > LEAST_INK, "{picture:?}");
}

/// Opens the page with Chromium.
pub fn is_legible_everywhere(page: &str, test: &str) {
    let Some(browser) = Browser::of(page, test) else {
        return;
    };
    for (place, width_px) in [("phone", PHONE_PX), ("desk", DESK_PX)] {
        let layout = browser.layout(width_px);
        lies_within(&layout, width_px, place);
        let size = (width_px, layout.height_px as u32);
        let [light, dark] = browser.pictures(size);
        is_drawn(&light, false);
        is_drawn(&dark, true);
    }
    let pdf = browser.print();
    assert!(pdf.starts_with(b"%PDF-"));
    let text = String::from_utf8_lossy(&pdf);
    let sheets = text.matches("/Type /Page\n").count();
    eprintln!("{test}: {sheets} sheets, {} kB", pdf.len() / 1024);
    assert!(sheets >= 1 && pdf.len() > 20_000);
    // The rules for print, on a window as wide as the sheet.
    assert!(page.contains("@media print"));
    let printed = Browser::of(&page.replace("@media print", "@media all"), test);
    lies_within(&printed.unwrap().layout(SHEET_PX), SHEET_PX, "print");
}

#[test]
fn what_a_page_fetches_is_noticed() {
    for one in [
        "<img src=\"http://a.example/x.png\">",
        "<img src=x.png>",
        "<script src='//a.example/x.js'>",
        "<link rel=\"stylesheet\" href=\"style.css\">",
        "<use xlink:href=\"other.svg#a\"/>",
        "<style>body { background: url(https://a.example/x) }</style>",
        "<style>@import \"x.css\";</style>",
    ] {
        assert_eq!(fetched(one).len(), 1, "{one}");
    }
    for one in [
        "<svg xmlns=\"http://www.w3.org/2000/svg\"></svg>",
        "<a href=\"#causes\">",
        "<p>see http://a.example, src and href</p>",
        "<img src=\"data:image/png;base64,AAAA\">",
    ] {
        assert_eq!(fetched(one), Vec::<String>::new(), "{one}");
    }
}
