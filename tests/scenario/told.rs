//! What a diagnosis tells a person: its sentences and tables, on a terminal and on a page.

use serde_json::Value;

/// The text of a page: what stands between tags, one piece a line; no styles and no drawings.
pub fn text_of(page: &str) -> String {
    let mut bare = page.to_owned();
    for element in ["style", "svg", "script"] {
        while let Some(from) = bare.find(&format!("<{element}")) {
            let end = format!("</{element}>");
            let to = from + bare[from..].find(&end).unwrap() + end.len();
            bare.replace_range(from..to, "");
        }
    }
    let pieces = bare.split('<').map(|piece| {
        let text = piece.split_once('>').map_or("", |(_, text)| text);
        text.replace("&lt;", "<")
            .replace("&gt;", ">")
            .replace("&quot;", "\"")
            .replace("&amp;", "&")
    });
    let pieces: Vec<String> = pieces.filter(|piece| !piece.trim().is_empty()).collect();
    pieces.join("\n")
}

/// The line that begins with `begin`.
pub fn sentence<'t>(text: &'t str, begin: &str) -> &'t str {
    let mut lines = text.lines().filter(|line| line.starts_with(begin));
    lines
        .next()
        .unwrap_or_else(|| panic!("no line begins with {begin:?} in\n{text}"))
}

/// The numbers after `mark`, as many as are wanted.
pub fn numbers_after<const N: usize>(text: &str, mark: &str) -> [f64; N] {
    // A person reads a minus sign, which a parser of numbers does not take.
    let (text, mark) = (&text.replace('−', "-"), &mark.replace('−', "-"));
    let place = text
        .find(mark.as_str())
        .unwrap_or_else(|| panic!("no {mark:?} in {text:?}"));
    let is_of_number = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    let mut words = text[place + mark.len()..]
        .split(|c: char| !is_of_number(c))
        .filter_map(|word| word.trim_end_matches('.').parse().ok());
    std::array::from_fn(|_| words.next().unwrap_or_else(|| panic!("{mark:?}: {text:?}")))
}

/// Two numbers that are one to three digits.
pub fn is_same(shown: f64, value: f64) -> bool {
    (shown - value).abs() <= 6e-3 * value.abs() + 1e-9
}

/// A cause as the report has it, by its effect and what it acts on, where it is named.
pub fn named<'r>(report: &'r Value, effect: &str, axis: &str) -> &'r Value {
    let causes = report["causes"].as_array().unwrap();
    let mut named = causes.iter().filter(|cause| cause["status"] == "named");
    named
        .find(|cause| cause["effect"] == effect && cause["axis"] == axis)
        .unwrap_or_else(|| panic!("{effect} {axis} is not named in {causes:#?}"))
}

/// A parameter in words: its key without the unit.
fn label_of(name: &str) -> String {
    let units = [
        "_um_per_h",
        "_um_per_m",
        "_um_per_k",
        "_um",
        "_urad",
        "_ms",
        "_min",
        "_s",
    ];
    let label = units.iter().find_map(|unit| name.strip_suffix(unit));
    label.unwrap_or(name).replace('_', " ")
}

/// A person reads of the named cause: what it is, where, its size with the interval, and how far the gap shrinks.
///
/// `title` is the effect in words with what it acts on; the text is a terminal's or that of a page.
pub fn is_told(text: &str, report: &Value, (effect, axis): (&str, &str), title: &str) {
    let cause = named(report, effect, axis);
    let first = &cause["parameters"][0];
    let name = first["name"].as_str().unwrap();
    let in_report = ["value", "low", "high"].map(|key| first[key].as_f64().unwrap());
    let same = |shown: &[f64], values: &[f64], what: &str| {
        let pairs = shown.iter().zip(values);
        let all = pairs.into_iter().all(|(a, b)| is_same(*a, *b));
        assert!(all, "{what}: {shown:?}, in the report {values:?}");
    };
    let which = sentence(text, "Which:");
    let said: [f64; 3] = numbers_after(which, &format!("{title} ({} ", label_of(name)));
    same(&said, &in_report, which);
    let table = &text[text.find("key of the machine file").unwrap()..];
    let row = &table[table.find(title).unwrap()..];
    same(&numbers_after::<3>(row, name), &in_report, "its row");

    let place = sentence(text, "Where:");
    let [rms_um] = numbers_after(place, "differ by ");
    same(
        &[rms_um],
        &[report["gap"]["rms_um"].as_f64().unwrap()],
        place,
    );
    let shrink = &report["shrink"];
    let far = sentence(text, "How far:");
    let [before_um, after_um, _] = numbers_after(far, " go from ");
    let around = ["before", "after"].map(|key| shrink["rms_um"][key].as_f64().unwrap());
    same(&[before_um, after_um], &around, far);
    let closed =
        ["value", "low", "high"].map(|key| 100.0 * shrink["gap_closed"][key].as_f64().unwrap());
    let shown: [f64; 3] = numbers_after(far, "µm rms; ");
    same(&shown, &closed, far);
}
