//! Rules of the kernels' source that the driver of the tests does not enforce.
use crate::files_below;
use std::path::{Path, PathBuf};

/// Every statement of the kernels that breaks a rule, with its file. A rule is told whether the statement is in a block behind a
/// condition that is no constant.
fn broken(rule: impl Fn(&str, bool) -> bool) -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let files = files_below(&root);
    assert!(files.len() > 100, "the kernels were not found");
    let of_file = |file: &PathBuf| {
        let found = broken_in(&std::fs::read_to_string(file).unwrap(), &rule);
        found.into_iter().map(|statement| format!("{}: {statement}", file.display())).collect::<Vec<_>>()
    };
    files.iter().flat_map(of_file).collect()
}

fn broken_in(text: &str, rule: &impl Fn(&str, bool) -> bool) -> Vec<String> {
    let code: Vec<&str> = text.lines().map(|line| line.split("//").next().unwrap()).collect();
    let code = code.join(" ");
    let (mut found, mut blocks, mut rest) = (Vec::new(), Vec::new(), &code[..]);
    while let Some(end) = rest.find([';', '{', '}']) {
        let statement = rest[..end].trim();
        let apart = blocks.contains(&true);
        if rule(statement, apart) {
            found.push(statement.to_owned());
        }
        match rest.as_bytes()[end] {
            b'{' => blocks.push(is_conditional(statement)),
            b'}' => drop(blocks.pop()),
            _ => {}
        }
        rest = &rest[end + 1..];
    }
    found
}

/// Whether a statement, or the block behind it, runs in some lanes alone. Loops that count in their heads, and what comes behind a
/// statement that some lanes leave by, are not looked at.
fn is_conditional(statement: &str) -> bool {
    let behind =
        |word: &str| statement.match_indices(word).map(|(at, _)| &statement[at + word.len()..]).collect::<Vec<_>>();
    let conditions = [behind("if ("), behind("while (")].concat();
    statement.starts_with("else") || conditions.into_iter().any(|text| !is_constant(inside(text)))
}

/// The text up to the bracket that ends it.
fn inside(text: &str) -> &str {
    let mut depth = 1;
    let end = text.find(|c| {
        depth += i32::from(c == '(') - i32::from(c == ')');
        depth == 0
    });
    &text[..end.unwrap_or(text.len())]
}

/// Whether a condition is made of constants, whose names have no small letters, or is the same in all lanes.
fn is_constant(condition: &str) -> bool {
    let words = condition.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    let mut names = words.filter(|word| word.starts_with(|c: char| c.is_ascii_alphabetic()));
    (condition.trim().starts_with("any_lane(") && !condition.contains("&&"))
        || names.all(|name| !name.contains(|c: char| c.is_ascii_lowercase()))
}

/// Whether a function of this name is called.
fn calls(statement: &str, name: &str) -> bool {
    let begins = |at: usize| !statement[..at].ends_with(|c: char| c.is_ascii_alphanumeric() || c == '_');
    statement.match_indices(&format!("{name}(")).any(|(at, _)| begins(at))
}

/// Vulkan lets them be off by 2^-11 and, beyond pi, by anything: `glsl/shared/warp.glsl` has others.
fn asks_for_a_sine(statement: &str, _: bool) -> bool {
    ["sin", "cos", "tan", "asin", "acos"].iter().any(|name| calls(statement, name))
}

/// Whether it reads a lane behind a condition that is no constant: the lane may be elsewhere then, and what is read is undefined.
fn reads_lanes_apart(statement: &str, apart: bool) -> bool {
    statement.match_indices("from_lane(").any(|(at, _)| {
        let before = &statement[..at];
        let condition = |text: &str| {
            let compared = ["==", "<=", ">=", "!="].iter().fold(text.to_owned(), |text, sign| text.replace(sign, "<"));
            compared.rsplit(['=', '(', ',', ':']).next().unwrap_or_default().to_owned()
        };
        let asked = before.rfind('?').is_some_and(|mark| !is_constant(&condition(&before[..mark])));
        apart || asked || is_conditional(before) || before.contains("&&") || before.contains("||")
    })
}

#[test]
fn kernels_ask_no_driver_for_sines() {
    let found = broken(asks_for_a_sine);
    assert!(found.is_empty(), "{found:#?}");
    let asks = |text| asks_for_a_sine(text, false);
    assert!(asks("float s = sin(x)") && asks("vec2(1.0, cos(x))"), "control");
    assert!(!asks("float s = sample_sin(x) + sine_cosine(x).x + atan(y, x)"));
}

#[test]
fn lanes_are_read_where_all_are() {
    let found = broken(reads_lanes_apart);
    assert!(found.is_empty(), "{found:#?}");
    let reads = |text: &str| !broken_in(text, &reads_lanes_apart).is_empty();
    for apart in [
        "uint bit = dealt ? from_lane(bits, owner) : 0u;",
        "bool met = hit && index != from_lane(from.x, owner);",
        "uint b = lane == LAST_LANE ? from_lane(x, 0u) : 0u;",
        "if (dealt) bit = from_lane(bits, owner);",
        "while (k < n) { bit = from_lane(bits, owner); }",
        "if (any_lane(met) && dealt) bit = from_lane(bits, owner);",
        "void f() { if (dealt) { int i = 1; bit = from_lane(bits, owner); } }",
        "if (LANES > 4u) { } else { bit = from_lane(bits, owner); }",
    ] {
        assert!(reads(apart), "control: {apart}");
    }
    for together in [
        "uint i = FX_INSTANCES ? from_lane(x, owner) : NONE;",
        "bool nearer = from_lane(r, at) == r && better;",
        "if (LANES > 16u) { lane += from_lane(ends, 15u) <= k ? 16u : 0u; }",
        "do { x = from_lane(y, 1u); } while (first < total);",
    ] {
        assert!(!reads(together), "{together}");
    }
}
