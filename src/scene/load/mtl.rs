//! MTL files through tobj: in any case and spelling, with the line of every mistake, options of maps and file names with
//! spaces. What the statements mean for a material is decided in `mtl_material.rs`.
use super::blocks::Statements;
use super::mapping::Mapping;
use crate::error::{Checked, Error, Result};
use crate::scene::description::texture::Wrap;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A statement that names a map.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// File name as written, but with backslashes turned to slashes.
    pub file: String,
    /// Height of a bump map, from `-bm`.
    pub bump: Option<f32>,
    /// Repetition and placement, from `-clamp on`, `-s` and `-o`.
    pub mapping: Mapping,
}

/// One `newmtl` block: what tobj reads of it, its texture statements with their options and all.
#[derive(Clone, Debug, Default)]
pub struct Mtl {
    /// Directory that maps are relative to.
    pub directory: PathBuf,
    /// Statements that tobj does not know are among its unknown parameters.
    pub block: tobj::Material,
}

impl Mtl {
    /// Name after `newmtl`.
    pub fn name(&self) -> &str {
        &self.block.name
    }

    /// Number of a statement that tobj does not know: Pr or Pm.
    pub fn number(&self, key: &str) -> Option<f32> {
        self.block.unknown_param.get(key)?.parse().ok()
    }

    /// Transmission filter `Tf`, linear RGB.
    pub fn tf(&self) -> Option<[f32; 3]> {
        color("Tf", self.block.unknown_param.get("Tf")?).ok()
    }

    /// Map of a statement that tobj does not know: norm or map_Pr.
    pub fn map(&self, key: &str) -> Option<Map> {
        map(self.block.unknown_param.get(key)?)
    }
}

/// Kind of the values that follow a statement.
#[derive(Clone, Copy)]
enum Kind {
    /// One number for all channels, or three.
    Color,
    Number,
    Map,
}

/// The statements that mean something here, in lower case; as tobj spells them; what follows. `Tr` is 1 - d, and does not count beside one: some
/// exporters write the same number for both.
const STATEMENTS: [(&str, &str, Kind); 20] = [
    ("kd", "Kd", Kind::Color),
    ("ks", "Ks", Kind::Color),
    ("ke", "Ke", Kind::Color),
    ("tf", "Tf", Kind::Color),
    ("ns", "Ns", Kind::Number),
    ("ni", "Ni", Kind::Number),
    ("d", "d", Kind::Number),
    ("tr", "d", Kind::Number),
    ("pr", "Pr", Kind::Number),
    ("pm", "Pm", Kind::Number),
    ("illum", "illum", Kind::Number),
    ("map_kd", "map_Kd", Kind::Map),
    ("map_ks", "map_Ks", Kind::Map),
    ("map_ke", "map_Ke", Kind::Map),
    ("map_d", "map_d", Kind::Map),
    ("map_pr", "map_Pr", Kind::Map),
    ("map_bump", "bump", Kind::Map),
    ("bump", "bump", Kind::Map),
    ("norm", "norm", Kind::Map),
    ("map_norm", "norm", Kind::Map),
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

/// The materials of a file, in its order. Statements that mean nothing here are passed over. tobj tells neither the line of
/// a mistake nor survives a colour of one number, so that every statement is checked on its way there.
///
/// # Errors
/// [`Error::Input`] with the line of a statement whose numbers are missing, not numbers, or not finite.
pub fn parse(path: &Path, text: &str) -> Result<Vec<Mtl>> {
    let (mut checked, mut within, mut has_d) = (String::new(), false, false);
    for (number, line) in Statements::of(text.trim_start_matches('\u{feff}')) {
        let line = line.trim();
        let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        if key.eq_ignore_ascii_case("newmtl") {
            (within, has_d) = (!rest.is_empty(), false); // a material without a name cannot be used
            checked.extend(within.then(|| format!("newmtl {rest}\n")));
        } else if within && !(has_d && key.eq_ignore_ascii_case("Tr")) {
            has_d |= key.eq_ignore_ascii_case("d");
            let place = || format!("line {number}");
            checked += &statement(key, rest).map_err(|what| Error::input_at(path, place(), what))?;
        }
    }
    let (blocks, _) = tobj::load_mtl_buf(&mut checked.as_bytes()).map_err(|e| Error::input(path, e.to_string()))?;
    let directory = path.parent().unwrap_or(Path::new(""));
    Ok(blocks.into_iter().map(|block| Mtl { directory: directory.to_owned(), block }).collect())
}

/// The statements that change what a material looks like and are not read, in lower case. Exporters write those without a value
/// as 0.
const UNREAD: [&str; 11] =
    ["map_pm", "map_ns", "map_ps", "map_pc", "disp", "map_disp", "decal", "refl", "pc", "ps", "aniso"];

/// Which of those a file has, as it first spells each, in their order.
pub fn unread(text: &str) -> Vec<String> {
    let mut found: BTreeMap<usize, String> = BTreeMap::new();
    for (_, line) in Statements::of(text) {
        let (key, rest) = next_word(line.trim());
        let place = UNREAD.iter().position(|lower| lower.eq_ignore_ascii_case(key));
        if let Some(place) = place.filter(|_| rest.parse() != Ok(0.0)) {
            found.entry(place).or_insert_with(|| key.to_owned());
        }
    }
    found.into_values().collect()
}

/// A statement as tobj reads it, with a line feed; nothing for one that means nothing here.
fn statement(key: &str, rest: &str) -> Checked<String> {
    let Some(&(lower, name, kind)) = STATEMENTS.iter().find(|(lower, ..)| lower.eq_ignore_ascii_case(key)) else {
        return Ok(String::new());
    };
    Ok(match kind {
        Kind::Color => color(key, rest).map(|[r, g, b]| format!("{name} {r} {g} {b}\n"))?,
        Kind::Number => {
            // `d -halo 0.5` fades towards grazing angles; only its number is kept.
            let value = number(key, rest.strip_prefix("-halo").unwrap_or(rest))?;
            match lower {
                "tr" => format!("{name} {}\n", 1.0 - value),
                // Models that nobody defined are as 2, the usual one.
                "illum" => format!("{name} {}\n", u8::try_from(value as i32).unwrap_or(2)),
                _ => format!("{name} {value}\n"),
            }
        }
        Kind::Map if map(rest).is_none() => String::new(),
        Kind::Map => format!("{name} {rest}\n"),
    })
}

fn number(key: &str, rest: &str) -> Checked<f32> {
    let word = rest.split_whitespace().next().unwrap_or("");
    match word.parse::<f32>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err(format!("{key} takes a finite number, not \"{word}\"")),
    }
}

/// Three numbers, or one for all channels. `spectral` and `xyz` forms have no meaning here.
fn color(key: &str, rest: &str) -> Checked<[f32; 3]> {
    let words: Vec<_> = rest.split_whitespace().take_while(|word| !word.starts_with('#')).take(3).collect();
    match words[..] {
        [_] => number(key, rest).map(|v| [v; 3]),
        [r, g, b] => Ok([number(key, r)?, number(key, g)?, number(key, b)?]),
        _ => Err(format!("{key} takes one number or three, not \"{rest}\"")),
    }
}

/// What follows a map statement: options first, then the file name, which may hold spaces.
pub fn map(rest: &str) -> Option<Map> {
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
                "-clamp" => found.mapping.wrap = [if word == "on" { Wrap::Clamp } else { Wrap::Repeat }; 2],
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

#[cfg(test)]
mod tests {
    use super::*;

    fn one(text: &str) -> Mtl {
        parse(Path::new("dir/a.mtl"), &format!("newmtl a b\n{text}")).unwrap().remove(0)
    }

    #[test]
    fn statements_are_read_in_any_case_and_form() {
        assert_eq!(parse(Path::new("a.mtl"), "\u{feff}newmtl a").unwrap().len(), 1);
        assert_eq!(
            one("Ns 3\rKd 0 1 \\\r0").block.diffuse,
            Some([0.0, 1.0, 0.0]),
            "lines of old Macintoshes, and long ones"
        );
        let m = one("  Kd 0.1 0.2 0.3\r\nKs 0.5\nNs 10\nTr 0.25\nillum 2\nkE 1 2 3\nunknown x\n# Kd 9 9 9");
        assert_eq!((m.name(), m.directory.as_path()), ("a b", Path::new("dir")));
        assert_eq!(m.block.diffuse, Some([0.1, 0.2, 0.3]));
        assert_eq!(one("Kd 0.5 # grey").block.diffuse, Some([0.5; 3]));
        assert_eq!((m.block.specular, m.block.emissive), (Some([0.5; 3]), Some([1.0, 2.0, 3.0])));
        assert_eq!(
            (m.block.shininess, m.block.dissolve, m.block.illumination_model),
            (Some(10.0), Some(0.75), Some(2))
        );
        for both in ["d 1\nTr 1", "Tr 1\nd 1"] {
            assert_eq!(one(both).block.dissolve, Some(1.0), "{both:?}");
        }
        let [_, second] = &parse(Path::new("a.mtl"), "newmtl a\nd 1\nnewmtl b\nTr 1").unwrap()[..] else { panic!() };
        assert_eq!(second.block.dissolve, Some(0.0));
        let m = one("Pr 0.5\nTf 0.25\nillum -1\nillum 1e20\nmap_norm a.png");
        assert_eq!((m.number("Pr"), m.tf(), m.block.illumination_model), (Some(0.5), Some([0.25; 3]), Some(2)));
        assert_eq!(m.map("norm").unwrap().file, "a.png");
        assert!(parse(Path::new("a.mtl"), "newmtl\nKd 1 0 0\n").unwrap().is_empty(), "nobody can wear it");
    }

    #[test]
    fn maps_have_options_spaces_and_backslashes() {
        let mapping = Mapping { wrap: [Wrap::Clamp; 2], scale: [2.0, -3.0], offset: [0.5, 0.0], ..Mapping::default() };
        let m = one("map_Kd -s 2 -3 1 -clamp on -o 0.5 tex\\my wood.png\nmap_Bump -bm 0.02 b.png\nnorm \"n 1.png\"");
        let of = |text: &Option<String>| map(text.as_ref().unwrap()).unwrap();
        assert_eq!(of(&m.block.diffuse_texture), Map { file: "tex/my wood.png".into(), bump: None, mapping });
        assert_eq!(
            of(&m.block.normal_texture),
            Map { file: "b.png".into(), bump: Some(0.02), mapping: Mapping::default() }
        );
        assert_eq!(m.map("norm").unwrap().file, "n 1.png");
        let odd = of(&one("map_Ks -s nan 1e30 -o inf a.png").block.specular_texture);
        assert_eq!((odd.file.as_str(), odd.mapping), ("a.png", Mapping::default()));
        assert_eq!(one("map_Kd -s 1 1 1").block.diffuse_texture, None);
    }

    #[test]
    fn what_is_not_read_is_named_unless_it_is_0() {
        assert_eq!(unread("newmtl a\nKd 1 0 0\nPs 0\nPc 0.000000\naniso 0\nmap_Ka a.png"), Vec::<String>::new());
        assert_eq!(
            unread("newmtl a\nPs 1\nMap_Ns a.png\nnewmtl b\nmap_ns b.png\n\trefl -type sphere c.png"),
            ["Map_Ns", "refl", "Ps"]
        );
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
