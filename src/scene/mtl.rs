//! MTL files as they are written: numbers, map statements with their options, file names with spaces. What the
//! statements mean for a material is decided in `material.rs`.
use super::texture::Mapping;
use crate::error::{Error, Result};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// A map statement.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// As written, backslashes turned.
    pub file: String,
    /// `-bm`: height of a bump map.
    pub bump: Option<f32>,
    /// `-clamp on`, `-s` and `-o`.
    pub mapping: Mapping,
}

/// One `newmtl` block. `None` is what the file does not say.
#[derive(Clone, Debug, Default)]
pub struct Mtl {
    /// After `newmtl`.
    pub name: String,
    /// Directory that maps are relative to.
    pub directory: PathBuf,
    /// Kd, Ks, Ke, Tf: by statement, one number or three.
    pub colors: HashMap<&'static str, [f32; 3]>,
    /// Ns, Ni, d, Pr, Pm, illum.
    pub numbers: HashMap<&'static str, f32>,
    /// By statement; `bump`, `map_bump` and `map_Bump` are one.
    pub maps: HashMap<&'static str, Map>,
}

const COLORS: [&str; 4] = ["Kd", "Ks", "Ke", "Tf"];
const NUMBERS: [&str; 7] = ["Ns", "Ni", "d", "Tr", "Pr", "Pm", "illum"];
/// Statement as written in lower case, name that it is kept under.
const MAPS: [(&str, &str); 9] = [
    ("map_kd", "map_Kd"),
    ("map_ks", "map_Ks"),
    ("map_ke", "map_Ke"),
    ("map_d", "map_d"),
    ("map_pr", "map_Pr"),
    ("map_bump", "bump"),
    ("bump", "bump"),
    ("norm", "norm"),
    ("map_norm", "norm"),
];
/// Options before a map's file name and the numbers or words that follow each (`-o`, `-s`, `-t`: up to three numbers).
const OPTIONS: [(&str, usize); 13] = [
    ("-blendu", 1),
    ("-blendv", 1),
    ("-boost", 1),
    ("-mm", 2),
    ("-o", 3),
    ("-s", 3),
    ("-t", 3),
    ("-texres", 1),
    ("-clamp", 1),
    ("-bm", 1),
    ("-imfchan", 1),
    ("-type", 1),
    ("-cc", 1),
];

/// The materials of a file, in its order. Statements that mean nothing here are passed over.
///
/// # Errors
/// [`Error::Input`] with the line of a statement whose numbers are missing, not numbers, or not finite.
pub fn parse(path: &Path, text: &str) -> Result<Vec<Mtl>> {
    let directory = path.parent().unwrap_or(Path::new("")).to_owned();
    let mut found: Vec<Mtl> = Vec::new();
    for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let line = line.trim();
        let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        if key.eq_ignore_ascii_case("newmtl") {
            found.push(Mtl { name: rest.trim().to_owned(), directory: directory.clone(), ..Mtl::default() });
        } else if let Some(mtl) = found.last_mut() {
            let place = || format!("line {}", number + 1);
            statement(mtl, key, rest.trim()).map_err(|what| Error::input_at(path, place(), what))?;
        }
    }
    Ok(found)
}

fn statement(mtl: &mut Mtl, key: &str, rest: &str) -> std::result::Result<(), String> {
    if let Some(&name) = COLORS.iter().find(|k| k.eq_ignore_ascii_case(key)) {
        mtl.colors.insert(name, color(key, rest)?);
    } else if let Some(&name) = NUMBERS.iter().find(|k| k.eq_ignore_ascii_case(key)) {
        // `d -halo 0.5` fades towards grazing angles; only its number is kept.
        let value = number(key, rest.strip_prefix("-halo").unwrap_or(rest))?;
        let (name, value) = if name == "Tr" { ("d", 1.0 - value) } else { (name, value) };
        mtl.numbers.insert(name, value);
    } else if let Some(&(_, name)) = MAPS.iter().find(|(k, _)| k.eq_ignore_ascii_case(key)) {
        mtl.maps.extend(map(rest).map(|map| (name, map)));
    }
    Ok(())
}

fn number(key: &str, rest: &str) -> std::result::Result<f32, String> {
    let word = rest.split_whitespace().next().unwrap_or("");
    match word.parse::<f32>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err(format!("{key} takes a finite number, not \"{word}\"")),
    }
}

/// Three numbers, or one for all channels. `spectral` and `xyz` forms have no meaning here.
fn color(key: &str, rest: &str) -> std::result::Result<[f32; 3], String> {
    let words: Vec<_> = rest.split_whitespace().take(3).collect();
    match words[..] {
        [_] => number(key, rest).map(|v| [v; 3]),
        [r, g, b] => Ok([number(key, r)?, number(key, g)?, number(key, b)?]),
        _ => Err(format!("{key} takes one number or three, not \"{rest}\"")),
    }
}

/// Options first, then the file name, which may hold spaces.
fn map(rest: &str) -> Option<Map> {
    let mut found = Map { file: String::new(), bump: None, mapping: Mapping::default() };
    let mut rest = rest;
    while rest.starts_with('-') {
        let (option, after) = next_word(rest);
        let Some(&(name, count)) = OPTIONS.iter().find(|(o, _)| *o == option) else { break };
        rest = after;
        for i in 0..count {
            let (word, after) = next_word(rest);
            if i > 0 && name != "-mm" && word.parse::<f32>().is_err() {
                break; // -o, -s and -t may have fewer than three numbers
            }
            match name {
                "-bm" => found.bump = word.parse().ok().filter(|v: &f32| v.is_finite()),
                "-clamp" => found.mapping.clamp = word == "on",
                "-s" => place(&mut found.mapping.scale, i, word),
                "-o" => place(&mut found.mapping.offset, i, word),
                _ => {}
            }
            rest = after;
        }
    }
    found.file = rest.trim().trim_matches('"').replace('\\', "/");
    (!found.file.is_empty()).then_some(found)
}

/// Number `i` of `-s` or `-o`. Beyond a million, coordinates have no digits left for a place in the picture.
fn place(numbers: &mut [f32; 2], i: usize, word: &str) {
    if let (Some(number), Ok(value)) = (numbers.get_mut(i), word.parse::<f32>()) {
        *number = if value.abs() <= 1e6 { value } else { *number };
    }
}

fn next_word(text: &str) -> (&str, &str) {
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim_start())
}

/// The file that `written` means, below `directory`. Where it does not exist as written: the same letters in another
/// case, or the bare file name next to the MTL (absolute paths of another machine). The flag says that it was mended.
pub fn find_file(directory: &Path, written: &str) -> Option<(PathBuf, bool)> {
    let exact = directory.join(written);
    if exact.is_file() {
        return Some((exact, false));
    }
    let bare = written.rsplit('/').next().unwrap_or(written);
    [written, bare].iter().find_map(|w| any_case(directory, w)).map(|path| (path, true))
}

fn any_case(directory: &Path, written: &str) -> Option<PathBuf> {
    let mut path = directory.to_owned();
    for part in written.split('/').filter(|p| !p.is_empty() && *p != ".") {
        let next = path.join(part);
        path = if part == ".." || next.exists() { next } else { entry_like(&path, part)? };
    }
    path.is_file().then_some(path)
}

fn entry_like(directory: &Path, name: &str) -> Option<PathBuf> {
    let entries = std::fs::read_dir(directory).ok()?;
    entries.flatten().find(|e| e.file_name().to_str().is_some_and(|f| f.eq_ignore_ascii_case(name))).map(|e| e.path())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(text: &str) -> Mtl {
        parse(Path::new("dir/a.mtl"), &format!("newmtl a b\n{text}")).unwrap().remove(0)
    }

    #[test]
    fn statements_are_read_in_any_case_and_form() {
        assert_eq!(parse(Path::new("a.mtl"), "\u{feff}newmtl a").unwrap().len(), 1);
        let m = one("  Kd 0.1 0.2 0.3\r\nKs 0.5\nNs 10\nTr 0.25\nillum 2\nkE 1 2 3\nunknown x\n# Kd 9 9 9");
        assert_eq!((m.name.as_str(), m.directory.as_path()), ("a b", Path::new("dir")));
        assert_eq!(m.colors["Kd"], [0.1, 0.2, 0.3]);
        assert_eq!((m.colors["Ks"], m.colors["Ke"]), ([0.5; 3], [1.0, 2.0, 3.0]));
        assert_eq!((m.numbers["Ns"], m.numbers["d"], m.numbers["illum"]), (10.0, 0.75, 2.0));
    }

    #[test]
    fn maps_have_options_spaces_and_backslashes() {
        let mapping = Mapping { clamp: true, scale: [2.0, -3.0], offset: [0.5, 0.0] };
        let m = one("map_Kd -s 2 -3 1 -clamp on -o 0.5 tex\\my wood.png\nmap_Bump -bm 0.02 b.png\nnorm \"n 1.png\"");
        assert_eq!(m.maps["map_Kd"], Map { file: "tex/my wood.png".into(), bump: None, mapping });
        assert_eq!((m.maps["bump"].file.as_str(), m.maps["bump"].bump), ("b.png", Some(0.02)));
        assert_eq!(m.maps["norm"].file, "n 1.png");
        let odd = &one("map_Ks -s nan 1e30 -o inf a.png").maps["map_Ks"];
        assert_eq!((odd.file.as_str(), odd.mapping), ("a.png", Mapping::default()));
        assert!(!one("map_Kd -s 1 1 1").maps.contains_key("map_Kd"));
    }

    #[test]
    fn bad_numbers_name_their_line() {
        let error = |text: &str| parse(Path::new("a.mtl"), text).unwrap_err().to_string();
        assert_eq!(error("newmtl a\nKd 1 x 0"), "a.mtl, line 2: Kd takes a finite number, not \"x\"");
        assert_eq!(error("newmtl a\n\nKe nan 0 0"), "a.mtl, line 3: Ke takes a finite number, not \"nan\"");
        assert!(error("newmtl a\nKd 1 2").contains("one number or three"));
        assert!(parse(Path::new("a.mtl"), "Kd 1 x 0").unwrap().is_empty(), "nothing before the first newmtl counts");
    }
}
