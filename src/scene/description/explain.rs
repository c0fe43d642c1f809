//! What is said of a mistake in a scene file, in words that need no knowledge of the parser.
use super::unknown::{LISTS, unknown};

/// The parser's `message` about what is at byte `at` of `text`, in one line that says what is expected there.
pub(super) fn explain(text: &str, at: usize, message: &str) -> String {
    wrong_table(text, at, message)
        .or_else(|| wrong_type(text, at, message))
        .or_else(|| unknown(message))
        .or_else(|| syntax(text, at, message))
        .unwrap_or_else(|| message.replace('\n', " "))
}

/// A header with one pair of brackets in place of two, or the other way.
fn wrong_table(text: &str, at: usize, message: &str) -> Option<String> {
    let (name, is_double) = header(text, at).filter(|_| message.starts_with("invalid type"))?;
    // What stands at the top is a table whatever the message says: a list may fill one, in the order of its keys.
    let is_table = !name.contains('.') || message.contains("a table");
    match (is_double, LISTS.contains(&name)) {
        (true, false) if is_table => Some(format!("there is only one {name}: write [{name}]")),
        (false, true) => Some(of_several(name)),
        _ => None,
    }
}

fn of_several(name: &str) -> String {
    format!("there may be several of {name}: write [[{name}]]")
}

/// The name of the table whose header begins at byte `at`, and whether that is one of several.
fn header(text: &str, at: usize) -> Option<(&str, bool)> {
    let before = text.get(..at)?.rsplit('\n').next()?;
    let header = text.get(at..)?.lines().next()?.trim();
    let name = header.trim_start_matches('[').split(']').next()?.trim();
    let is_one = before.trim().is_empty() && header.starts_with('[') && name.starts_with(char::is_alphabetic);
    is_one.then_some((name, header.starts_with("[[")))
}

/// "invalid type: map, expected f64" becomes what the key takes, with an example, and what it was given.
fn wrong_type(text: &str, at: usize, message: &str) -> Option<String> {
    let starts = ["invalid type: ", "invalid value: ", "invalid length "];
    let rest = starts.iter().find_map(|start| message.strip_prefix(start))?;
    let (found, expected) = rest.rsplit_once(", expected ")?;
    let of_header = || header(text, at)?.0.rsplit('.').next().map(str::to_owned);
    // A header comes first: what stands above it is the value of another key.
    let key = of_header().or_else(|| key_before(text, at));
    if let Some(name) = key.as_deref().filter(|name| expected == "a sequence" && LISTS.contains(name)) {
        return Some(of_several(name));
    }
    let expected = match expected {
        "f32" | "f64" => "a number, such as 0.5".to_owned(),
        "u32" => "a whole number from 0 to 4294967295".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "a string" | "path string" => "a text in quotes, such as \"name\"".to_owned(),
        "a sequence" => "a list in brackets".to_owned(),
        other => match other.strip_prefix("an array of length ") {
            Some(count) => {
                format!("{count} numbers in brackets{}", if count == "3" { ", such as [0, 1, 0]" } else { "" })
            }
            None if other.starts_with("struct ") => "a table, such as { key = value }".to_owned(),
            None => other.to_owned(),
        },
    };
    let found = match found {
        "map" => "a table",
        "sequence" => "a list",
        count if message.starts_with(starts[2]) => &format!("{count} values"),
        text if text.starts_with("string ") => text.trim_start_matches("string "),
        // As in "integer `-1`".
        value => value.split('`').nth(1).unwrap_or(value),
    };
    Some(match key {
        Some(key) => format!("{key} takes {expected}, not {found}"),
        None => format!("{expected} is expected here, not {found}"),
    })
}

/// The key of the value that begins at byte `at`, or of the list of numbers in which it stands.
fn key_before(text: &str, at: usize) -> Option<String> {
    // Numbers may be 1e5, 0xff and inf.
    let is_of_list = |c: char| c.is_whitespace() || c.is_alphanumeric() || "[,.+-_\"'".contains(c);
    let before = text.get(..at)?.split('\n').map(code).collect::<Vec<_>>().join("\n");
    let before = before.trim_end_matches(is_of_list).strip_suffix('=')?.trim_end();
    let is_of_key = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    Some(before.rsplit(|c| !is_of_key(c)).next()?.to_owned()).filter(|key| !key.is_empty())
}

/// A line without its comment.
fn code(line: &str) -> &str {
    let mut quote = None;
    for (i, c) in line.char_indices() {
        match quote {
            None if c == '#' => return &line[..i],
            None => quote = ['"', '\''].into_iter().find(|&q| q == c),
            Some(q) => quote = quote.filter(|_| q != c),
        }
    }
    line
}

/// What the parser says of words without quotes and of lists without commas leads astray.
fn syntax(text: &str, at: usize, message: &str) -> Option<String> {
    let field =
        message.strip_prefix("missing field ").map(|field| format!("the key {} is missing", field.replace('`', "\"")));
    if let Some((key, path)) = bare_path(text, at) {
        // Between double ones a backslash begins a code.
        let quote = if path.contains('\\') { '\'' } else { '"' };
        return Some(format!("{key} takes a text in quotes: {quote}{path}{quote}"));
    }
    let said = match message.lines().next()? {
        m if m.starts_with("string values must be quoted") && is_end(text, at) => return Some(no_value(text, at)),
        m if m.starts_with("string values must be quoted")
            && text[at..].starts_with(['“', '”', '„', '‘', '’', '«']) =>
        {
            "a text stands between straight quotes, \" or '"
        }
        m if m.starts_with("string values must be quoted") && has_unit(text, at) => NUMBER,
        m if m.starts_with("string values must be quoted") => {
            "texts stand in quotes, and the values of a list have commas between them"
        }
        m if BAD_ESCAPE.iter().any(|start| m.starts_with(start)) => {
            "a backslash between double quotes begins a code, such as \\n: write / in its place, or single quotes"
        }
        m if m.starts_with("unexpected leading zero") => "no 0 stands before other digits, as in 5, 10 and 0.5",
        m if NO_NUMBER.iter().any(|start| m.starts_with(start)) => NUMBER,
        m if m.starts_with("unexpected key or value") && text.get(at..).is_some_and(|rest| rest.starts_with(',')) => {
            comma(text, at)
        }
        m if m.starts_with("key with no value") || m.starts_with("invalid key-value pair") => {
            "a line is the header of a table, such as [film], or a key with its value, such as width = 512"
        }
        m if m.starts_with("duplicate key") => return Some(again(text, at)),
        m if m.starts_with("invalid boolean") => "texts stand in quotes, and true and false are written so",
        m if m.starts_with("wanted exactly 1 element") || m.starts_with("wanted string") => {
            return Some(word(text, at));
        }
        m if m.contains("untagged enum Numbers") => "a key takes a number or a list of numbers",
        _ => return field,
    };
    Some(said.to_owned())
}

/// What is said of the key at byte `at`, or of the table of that header, which the file has above, too.
fn again(text: &str, at: usize) -> String {
    let is_of_key = |c: &char| c.is_alphanumeric() || "_-.\"'".contains(*c);
    let name: String = text.get(at..).unwrap_or_default().chars().take_while(is_of_key).collect();
    let before = text.get(..at).and_then(|before| before.rsplit('\n').next()).unwrap_or_default();
    match before.trim_start().starts_with('[') {
        true => format!("the table {name} stands above, too: put all of its keys into one"),
        false => format!("{name} stands above, too: keep one of them"),
    }
}

/// The path without quotes in which byte `at` stands, and its key: the parser takes 01.png for a number and 2024-01-01.png for a date.
fn bare_path(text: &str, at: usize) -> Option<(String, &str)> {
    let line = text.get(..at)?.rfind('\n').map_or(0, |end| end + 1);
    let from = line + 1 + text[line..at].contains('=').then(|| text[line..at].rfind(['=', '[', ',']))??;
    let value = code(text[from..].lines().next()?).split([',', ']', '}']).next()?.trim();
    let (_, ending) = value.rsplit_once('.').filter(|_| !value.contains(['"', '\'', '{', '=']))?;
    if text[at..].starts_with(',') {
        return None;
    }
    // 5.f and 1.e5 are meant as numbers.
    let is_ending = ending.chars().count() > 1 && ending.chars().all(char::is_alphanumeric);
    let is_number = ending.chars().skip(1).all(|c| c.is_ascii_digit());
    let is_path = is_ending && !ending.starts_with(|c: char| c.is_ascii_digit()) && !is_number;
    is_path.then_some((key_before(text, from)?, value))
}

/// What the parser says of .5, 5., 1e, 5deg and 1.0.0.
const NO_NUMBER: [&str; 4] = ["invalid mantissa", "invalid fraction", "invalid exponent", "invalid float"];

/// What the parser says of backslashes that begin no code, as those of a path of Windows.
const BAD_ESCAPE: [&str; 2] = ["missing escaped value", "too few unicode value digits"];

/// How numbers are written.
const NUMBER: &str = "a number begins and ends with a digit, has one point at most and no unit, such as 0.5, 2.0 or 1e-3; a text stands in quotes";

/// Whether a number with a unit stands at byte `at`, as in 35mm. Numbers without commas between them have none.
fn has_unit(text: &str, at: usize) -> bool {
    let line = text.get(at..).and_then(|rest| rest.split(['\n', ',', ']', '}']).next()).map_or("", code);
    let unit = line.trim_start_matches(|c: char| c.is_ascii_digit() || c.is_whitespace() || "+-._".contains(c));
    line.starts_with(|c: char| c.is_ascii_digit()) && !unit.is_empty()
}

/// What is wrong with the comma at byte `at`, which stands behind a value.
fn comma(text: &str, at: usize) -> &'static str {
    let before = text.get(..at).and_then(|before| before.rsplit(['\n', '=']).next()).unwrap_or_default();
    match before.trim().parse::<f64>() {
        _ if is_end(text, at + 1) => "no comma stands at the end of a line here",
        Ok(_) => "a list stands in brackets, such as [0, 1, 0], and a number has a point, such as 0.5",
        Err(_) => "a list stands in brackets, and its texts in quotes, such as [\"a\", \"b\"]",
    }
}

/// Whether nothing stands on the line behind byte `at`.
fn is_end(text: &str, at: usize) -> bool {
    text.get(at..).is_some_and(|rest| code(rest.split('\n').next().unwrap_or_default()).trim().is_empty())
}

fn no_value(text: &str, at: usize) -> String {
    match key_before(text, at) {
        Some(key) => format!("the value of {key} is missing"),
        None => "a value is missing here".to_owned(),
    }
}

/// What a key takes that knows a few words.
fn word(text: &str, at: usize) -> String {
    let Some(key) = key_before(text, at) else { return "a text in quotes is expected here".to_owned() };
    let table = text[..at].lines().rev().map(str::trim_start).find(|line| line.starts_with('[')).unwrap_or_default();
    let example = match key.as_str() {
        "shape" => ", such as \"cube\"",
        "type" if table.contains("light") => ", such as \"point\"",
        "type" => ", such as \"diffuse\"",
        _ => "",
    };
    format!("{key} takes a text in quotes{example}")
}

#[cfg(test)]
mod tests {
    use crate::scene::description::parse;
    use std::path::Path;

    #[track_caller]
    fn says(text: &str, expected: &str) {
        let error = parse(Path::new("s.toml"), text).unwrap_err().to_string();
        assert!(error.contains(expected), "{text}: {error}");
        assert!(!error.contains("f64") && !error.contains("sequence") && !error.contains("struct"), "{text}: {error}");
    }

    /// As [`says`], of the whole sentence.
    #[track_caller]
    fn ends(text: &str, expected: &str) {
        says(text, expected);
        let error = parse(Path::new("s.toml"), text).unwrap_err().to_string();
        assert!(error.ends_with(expected), "{text}: {error}");
    }

    #[test]
    fn values_of_another_type_are_told_with_key_and_example() {
        let placed =
            "line 3: transform takes 16 numbers, row by row, or a table such as { translate = [0, 1, 0], rotate =";
        for list in ["[{ scale = 2 }]", "[1, 2, 3]", "[[1, 0, 0, 0]]", "'up'", "2"] {
            says(&format!("[[mesh]]\nshape = 'cube'\ntransform = {list}"), placed);
        }
        let moved = "line 2: translate takes 3 numbers in brackets, such as [0, 1, 0], not a table";
        says("[[mesh]]\ntransform = { translate = { x = 1 } }", moved);
        says("[camera]\nposition = [\n  0,\n  'a', 2]", "line 4: position takes a number, such as 0.5, not \"a\"");
        says("[camera]\nposition = [0, 1]", "position takes 3 numbers in brackets, such as [0, 1, 0], not 2 values");
        says("[camera]\nfov = '45'", "fov takes a number, such as 0.5, not \"45\"");
        says("[render]\nspp = 16.0", "spp takes a whole number from 0 to 4294967295, not 16.0");
        says("[render]\nspp = -1", "spp takes a whole number from 0 to 4294967295, not -1");
        says("[[mesh]]\nflat = 1", "flat takes true or false, not 1");
        says("[[mesh]]\nfile = ['a.obj']", "file takes a text in quotes, such as \"name\", not a list");
        for shape in ["{ type = 'cube', size = 2 }", "3", "['cube']"] {
            says(&format!("[[mesh]]\nshape = {shape}"), "line 2: shape takes a text in quotes, such as \"cube\"");
        }
        says("[[light]]\ntype = 3", "line 2: type takes a text in quotes, such as \"point\"");
        says("[[material]]\ntype = 3", "line 2: type takes a text in quotes, such as \"diffuse\"");
        says("[[material]]\ncolor = '#ff0000'", "color takes a number or [r, g, b], not \"#ff0000\"");
        says("[[material]]\ncolor = [1, 0, 0, 1]", "line 2: color takes a number or [r, g, b], not 4 values");
        says("[[mesh]]\ntransform = { scale = [1, 2, 3, 4] }", "scale takes a number or [x, y, z], not 4 values");
        says("environment = 'a.hdr'", "environment takes a table, such as { key = value }, not \"a.hdr\"");
        says("[[animation]]\nkeys = [{ time = 0, fov = 'a' }]", "a key takes a number or a list of numbers");
        says("[[instance]]\n", "the key \"mesh\" is missing");
        for table in ["3", "{ shape = 'cube' }", "'a.obj'"] {
            says(&format!("mesh = {table}"), "line 1: there may be several of mesh: write [[mesh]]");
        }
        says("[film]\nfilter = \"te`nt\"", "unknown value \"te`nt\": did you mean \"tent\"? Known: box, ");
        for end in ["", " ", "\n", " # degrees\nposition = [1, 2, 3]"] {
            says(&format!("[camera]\nfov ={end}"), "line 2: the value of fov is missing");
        }
    }

    #[test]
    fn keys_are_those_of_the_value_and_of_no_other_line() {
        let number = "takes a number, such as 0.5, not \"a\"";
        for list in
            ["[1e5, 'a', 3]", "[0xff, 1_0, 'a']", "[-inf, 'a', 3]", "[\n0, # y = 1\n'a', 2]", "[ # it's = 3\n'a']"]
        {
            says(&format!("[camera]\nposition = {list}"), &format!("position {number}"));
        }
        for above in ["roughness = 0.5", "roughness = 0xff\n\n", "name = '1' # y = 2", "name = '# = 1'"] {
            let header = format!("[[material]]\n{above}\n[material.color]\nr = 1");
            says(&header, ": color takes a number or [r, g, b], not a table");
        }
    }

    #[test]
    fn numbers_that_are_too_many_are_refused() {
        let three = "[[light]]\ntype = 'spot'\n";
        let picture = "[[material]]\ncolor_texture = { file = 'a.png',";
        for (before, key, count, after) in [
            ("[camera]\n", "position", 3, ""),
            ("[camera]\n", "target", 3, ""),
            ("[camera]\n", "up", 3, ""),
            ("[camera]\n", "world_from_camera", 16, ""),
            ("[environment]\n", "world_from_environment", 9, ""),
            ("[[mesh]]\ntransform = {", "translate", 3, "}"),
            ("[[mesh]]\n", "transform", 16, ""),
            (three, "position", 3, ""),
            (three, "direction", 3, ""),
            (three, "target", 3, ""),
            (picture, "offset", 2, "}"),
            (picture, "scale", 2, "}"),
        ] {
            let line = |count: usize| {
                let identity = (0..count).map(|i| if i % 5 == 0 { "1" } else { "0" });
                format!("{before}{key} = [{}]{after}", identity.collect::<Vec<_>>().join(", "))
            };
            for wrong in [count - 1, count + 1] {
                says(&line(wrong), &format!("{key} takes {count} numbers"));
                says(&line(wrong), &format!(", not {wrong} values"));
            }
            assert!(parse(Path::new("s.toml"), &line(count)).is_ok(), "control: {key}");
        }
    }

    #[test]
    fn headers_have_as_many_brackets_as_there_may_be_tables() {
        says("[film]\n[mesh]\nshape = 'cube'", "line 2: there may be several of mesh: write [[mesh]]");
        says("[[film]]\nwidth = 8", "line 1: there is only one film: write [film]");
        says("[[camera]]\nposition = [0, 0, 3]", "line 1: there is only one camera: write [camera]");
        says(
            "[[mesh]]\n[[mesh.transform]]\nscale = 2",
            "line 2: there is only one mesh.transform: write [mesh.transform]",
        );
        says("[[animation]]\n[animation.keys]\ntime = 0", "line 2: there may be several of animation.keys: write [[");
        says("[[animation]]\n[[animation.keys]]\ntime = 'a'", "takes a number, such as 0.5, not \"a\"");
        says("[[material]]\n[material.color]\nr = 1", "color takes a number or [r, g, b], not a table");
        says(
            "[[mesh]]\n[[mesh.file]]\nname = 'a'",
            "line 2: file takes a text in quotes, such as \"name\", not a list",
        );
        says(
            "[environment]\n[[environment.radiance]]\nr = 1",
            "line 2: radiance takes a number or [r, g, b], not a list",
        );
        says("[[allocate]]\npolicy = 'both'", "there is only one allocate: write [allocate]");
        says("[[environment]]\n", "there is only one environment: write [environment]");
    }

    #[test]
    fn words_without_quotes_and_lists_without_commas_are_told() {
        says("[film]\nfilter = tent", "line 2: texts stand in quotes");
        says("[[mesh]]\nfile = a", "line 2: texts stand in quotes");
        says("[[mesh]]\nflat = True", "true and false are written so");
        let list = "[camera]\nposition = [0 0 3]";
        ends(list, "line 2: texts stand in quotes, and the values of a list have commas between them");
    }

    /// Most begin as a number or a date does.
    #[test]
    fn paths_without_quotes_are_told() {
        let numbers =
            ["3d.obj", "2nd room.obj", "1.obj", "1e5.png", "3.5.obj", "01.png", "0x1.png", "0b1.obj", "inf.png"];
        let dates = ["2024-01-01.png", "2024-13-01.png", "10:30:00.png", "12:30.obj", "2024-01-01T00:00:00.png"];
        let others = [
            "a.obj",
            ".png",
            "../a.obj",
            "a b.png",
            "true.png",
            "/tmp/a.obj",
            "a.\u{f6}bj",
            "a.\u{e9}t",
            "b.\u{578b}\u{578b}",
        ];
        for name in numbers.into_iter().chain(dates).chain(others) {
            let told = format!("line 2: file takes a text in quotes: \"{name}\"");
            ends(&format!("[[mesh]]\nfile = {name}"), &told);
            ends(&format!("[[mesh]]\nfile = {name} # it's = a.b"), &told);
            let told = format!("line 2: bump takes a text in quotes: \"{name}\"");
            ends(&format!("[[material]]\nbump = {{ file = {name}, uv = 1 }}"), &told.replace("bump", "file"));
        }
        ends("[[mesh]]\nfile = C:\\x\\a.obj", "line 2: file takes a text in quotes: 'C:\\x\\a.obj'");
        says("[film]\nwidth = 1\n[film.size", "line 3: ");
        assert!(!parse(Path::new("s.toml"), "a = 1\n[film.size").unwrap_err().to_string().contains("quotes"));
    }

    #[test]
    fn what_stands_twice_is_named() {
        ends("[film]\nwidth = 1\nheight = 1\nwidth = 2", "line 4: width stands above, too: keep one of them");
        ends(
            "[film]\nwidth = 1\n[camera]\n[film]\n",
            "line 4: the table film stands above, too: put all of its keys into one",
        );
        ends("[[mesh]]\ntransform = { scale = 1, scale = 2 }", "line 2: scale stands above, too: keep one of them");
    }

    /// Files of JSON, YAML and XML get the first, and texts that a word processor wrote the second.
    #[test]
    fn lines_of_other_languages_are_told() {
        let line =
            "line 1: a line is the header of a table, such as [film], or a key with its value, such as width = 512";
        for text in ["{\"film\": {}}", "film:\n  width: 3", "<scene version=\"3.0.0\"></scene>", "width 512"] {
            ends(text, line);
        }
        for text in ["“cube”", "„cube“", "‘cube’", "«cube»"] {
            ends(&format!("[[mesh]]\nshape = {text}"), "line 2: a text stands between straight quotes, \" or '");
        }
    }

    #[test]
    fn backslashes_that_begin_no_code_are_told() {
        for path in [r"C:\dir\b.obj", r"C:\Users\b.obj", r"C:\x\b.obj", r"\\server\share", r"a\ b.obj"] {
            let text = format!("[[mesh]]\nfile = \"{path}\"");
            ends(
                &text,
                "line 2: a backslash between double quotes begins a code, such as \\n: write / in its place, or single quotes",
            );
        }
        assert!(parse(Path::new("s.toml"), r"mesh = [{ file = 'C:\dir\b.obj' }]").is_ok(), "control");
    }

    #[test]
    fn numbers_that_are_none_are_told() {
        let number = "a number begins and ends with a digit, has one point at most and no unit, such as 0.5, 2.0 or 1e-3; a text \
                      stands in quotes";
        let zero = "no 0 stands before other digits, as in 5, 10 and 0.5";
        let words = [".5", "-.5", "+.5", "5.", "1.e5", "1e", "5deg", "0.5f", "1.0.0", "35mm", "5px", "90°", "5 deg"];
        for (word, told) in words.map(|word| (word, number)).into_iter().chain([("05", zero), ("-010", zero)]) {
            ends(&format!("[camera]\nfov = {word}"), &format!("line 2: {told}"));
            ends(&format!("[camera]\nposition = [0, {word}, 1]"), &format!("line 2: {told}"));
        }
    }

    #[test]
    fn commas_without_brackets_are_told() {
        let of_numbers = "line 2: a list stands in brackets, such as [0, 1, 0], and a number has a point, such as 0.5";
        let of_texts = "line 2: a list stands in brackets, and its texts in quotes, such as [\"a\", \"b\"]";
        let end = "line 2: no comma stands at the end of a line here";
        for (line, told) in [
            ("fov = 0,5", of_numbers),
            ("position = 0, 1, 0", of_numbers),
            ("file = a.obj, b.obj", of_texts),
            ("file = 'a.obj', 'b.obj'", of_texts),
            ("width = 64,", end),
            ("shape = 'cube', # a cube\nfile = 'a.obj'", end),
            ("position = [0, 0, 1],\n", end),
        ] {
            ends(&format!("[camera]\n{line}"), told);
        }
    }
}
