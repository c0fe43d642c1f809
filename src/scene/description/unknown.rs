//! What is said of keys and values that are not known.
use super::Description;

/// Tables of which there may be several.
pub(super) const LISTS: [&str; 6] = ["mesh", "instance", "material", "light", "animation", "animation.keys"];

/// "unknown field `widht`, expected one of `width`, `height`" becomes one line with the nearest name first.
pub(super) fn unknown(message: &str) -> Option<String> {
    let kind = match message {
        m if m.starts_with("unknown field") => "key",
        m if m.starts_with("unknown variant") => "value",
        _ => return None,
    };
    let (unknown, known) = words(message);
    let hint = hint(unknown, &known, kind == "key").map_or_else(|| ".".to_owned(), |hint| format!(": {hint}"));
    let known = if known.is_empty() { String::new() } else { format!(" Known: {}", known.join(", ")) };
    Some(format!("unknown {kind} \"{unknown}\"{hint}{known}"))
}

/// The word that is not known, and those that are.
fn words(message: &str) -> (&str, Vec<&str>) {
    // The word itself may have such quotes.
    let (unknown, known) = message.rsplit_once("`, expected").unwrap_or_else(|| (message.trim_end_matches('`'), ""));
    let unknown = unknown.split_once('`').map_or("", |(_, word)| word);
    (unknown, known.split('`').skip(1).step_by(2).collect())
}

/// What a word stands for that is not among the known ones: what other renderers call so, or the known one most like it, and
/// which tables have such a key.
fn hint(unknown: &str, known: &[&str], is_key: bool) -> Option<String> {
    let of = |value| known.contains(&value);
    match unknown {
        "area" | "rect" | "quad" | "disk" if of("directional") => {
            return Some("what shines from an area is a mesh whose material has an emission.".to_owned());
        }
        "infinite" | "envmap" | "sky" | "dome" if of("directional") => {
            return Some("what shines from all around is the table [environment].".to_owned());
        }
        "color" | "power" | "energy" | "strength" if of("irradiance") => {
            return Some("a light has an intensity, or an irradiance where it is directional.".to_owned());
        }
        _ => {}
    }
    let elsewhere = ELSEWHERE.iter().find(|(here, words)| of(here) && words.contains(&unknown));
    let word = elsewhere.map_or(unknown, |(here, _)| here);
    let near = nearest(word, known.iter().copied());
    let near = near.filter(|near| strsim::jaro_winkler(word, near) >= LEAST_LIKENESS);
    let near = near.map(|near| format!("did you mean \"{near}\"?"));
    let owner = if is_key && elsewhere.is_none() { owner(unknown) } else { None };
    let said: Vec<_> = near.into_iter().chain(owner).collect();
    (!said.is_empty()).then(|| said.join(" "))
}

/// Where a key of this name stands.
fn owner(key: &str) -> Option<String> {
    let header = |name: &str| if LISTS.contains(&name) { format!("[[{name}]]") } else { format!("[{name}]") };
    let tables = keys("");
    if tables.iter().any(|name| name == key) {
        return Some(format!("{} is a table of its own.", header(key)));
    }
    let headers = tables.iter().map(|name| header(name));
    let owners: Vec<_> = headers.filter(|header| keys(header).iter().any(|known| known == key)).collect();
    match &owners[..] {
        [] => None,
        [one] => Some(format!("{one} has \"{key}\".")),
        [others @ .., last] => Some(format!("{} and {last} have \"{key}\".", others.join(", "))),
    }
}

/// The keys of the table with this header, or of a whole file, which the parser names where it meets one that is not known.
fn keys(header: &str) -> Vec<String> {
    let error = toml::from_str::<Description>(&format!("{header}\n\"\" = 0")).err();
    let message = error.as_ref().map_or("", |e| e.message());
    words(message).1.into_iter().map(str::to_owned).collect()
}

/// Keys and values, and what other programs call them; of several that are known where the word stands the first counts.
const ELSEWHERE: [(&str, &[&str]); 21] = [
    ("directional", &["sun", "distant"]),
    ("diffuse", &["matte", "lambertian"]),
    ("conductor", &["metal"]),
    ("dielectric", &["glass"]),
    ("coated", &["plastic"]),
    ("metallic-roughness", &["pbr", "principled", "disney"]),
    ("cube", &["box"]),
    ("rectangle", &["plane", "quad", "square"]),
    ("transform", &["position", "translate", "rotate", "scale", "matrix"]),
    ("translate", &["position"]),
    ("shape", &["type"]),
    ("file", &["path", "image"]),
    ("target", &["look_at", "lookat"]),
    ("lens_radius", &["aperture"]),
    ("color", &["base_color", "albedo", "diffuse", "reflectance"]),
    ("color_texture", &["texture"]),
    ("radiance", &["color", "intensity", "strength"]),
    ("environment", &["sky", "world", "background"]),
    ("width", &["resolution", "size"]),
    ("spp", &["samples", "samples_per_pixel", "sample_count"]),
    ("max_depth", &["depth", "bounces", "max_bounces"]),
];

/// Words that are less alike, from 0 to 1, are not taken for one another: "sun" and "render" have .5.
const LEAST_LIKENESS: f64 = 0.7;

/// The name that is most like `word`.
pub(in crate::scene) fn nearest<'a>(word: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let like = |name: &str| (strsim::jaro_winkler(word, name) * 1e6) as u32;
    names.max_by_key(|name| like(name))
}

#[cfg(test)]
mod tests {
    use crate::scene::description::parse;
    use std::path::Path;

    fn error(text: &str) -> String {
        parse(Path::new("s.toml"), text).unwrap_err().to_string()
    }

    #[test]
    fn keys_of_other_tables_are_told_by_those() {
        for (text, told) in [
            ("[render]\nwidth = 8", "unknown key \"width\": [film] has \"width\". Known: spp, "),
            ("[camera]\nfilter = 'box'", "unknown key \"filter\": [film] has \"filter\". Known: position, "),
            ("[film]\nfov = 40", ": [camera] has \"fov\"."),
            ("[film]\npolicy = 'both'", ": [allocate] has \"policy\"."),
            ("[camera]\nradiance = 1", ": [environment] has \"radiance\"."),
            ("width = 8", "line 1: unknown key \"width\": [film] has \"width\". Known: film, "),
            ("[render]\nposition = [0, 0, 1]", ": [camera] and [[light]] have \"position\"."),
            ("[film]\nfile = 'a.png'", "[environment], [[mesh]] and [[animation]] have \"file\"."),
            ("[allocate]\nspp = 4", ": [render] has \"spp\"."),
            ("[[light]]\nradiance = 1", "did you mean \"irradiance\"? [environment] has \"radiance\"."),
            ("[film.camera]\nfov = 40", "unknown key \"camera\": [camera] is a table of its own."),
            ("[camera]\n[[camera.light]]", "unknown key \"light\": [[light]] is a table of its own."),
            ("[camera]\nxyz = 1", "unknown key \"xyz\". Known: position, "),
        ] {
            let found = error(text);
            assert!(found.contains(told), "{text}: {found}");
        }
        // What it is called here comes first.
        for text in ["[[mesh]]\nposition = 1", "[[light]]\ncolor = 1", "[film]\nfilter = 'spp'"] {
            assert!(!error(text).contains("] ha"), "{}", error(text));
        }
    }

    /// By their letters "samples" was "sampler", and "base_color" "specular".
    #[test]
    fn words_of_other_programs_are_answered_by_those_of_this_one() {
        for (text, here) in [
            ("[render]\nsamples = 4", "spp"),
            ("[render]\nsamples_per_pixel = 4", "spp"),
            ("[render]\nmax_bounces = 4", "max_depth"),
            ("[film]\nresolution = [8, 8]", "width"),
            ("[camera]\nlook_at = [0, 0, 0]", "target"),
            ("[environment]\ncolor = 1", "radiance"),
            ("[sky]\ncolor = 1", "environment"),
            ("[[mesh]]\ntype = 'cube'", "shape"),
            ("[[mesh]]\nshape = 'box'", "cube"),
            ("[[mesh]]\nposition = [0, 1, 0]", "transform"),
            ("[[mesh]]\ntransform = { position = [0, 1, 0] }", "translate"),
            ("[[material]]\nbase_color = 1", "color"),
            ("[[material]]\ntype = 'glass'", "dielectric"),
        ] {
            let found = error(text);
            assert!(found.contains(&format!(": did you mean \"{here}\"?")), "{text}: {found}");
        }
    }
}
