//! Generates GLSL for the structs in `src/layout` and for the functions with which kernels read and write them, so that no
//! kernel depends on the offset of a field.
use crate::interface::Binding;
use crate::layout::{Field, GLSL_CONSTANTS, STRUCTS, Struct};
use std::ops::Range;

fn structs() -> impl Iterator<Item = &'static Struct> {
    STRUCTS.into_iter().flatten()
}

/// Returns the text to put before a kernel with these bindings: constants, structs, and the functions of the structs that
/// it binds.
pub fn glsl(bindings: &[Binding]) -> String {
    let mut text = GLSL_CONSTANTS.to_owned();
    for s in structs() {
        let fields: String = s.fields.iter().map(|f| format!("    {} {};\n", f.ty, f.name)).collect();
        text += &format!("struct {} {{\n{fields}}};\n", s.name);
        let bound = || bindings.iter().filter(|b| b.element == s.name);
        if bound().any(|b| b.kind != "Uniform") {
            text += &zero(s);
        }
        if bound().any(|b| b.kind == "UintTexels") {
            text += &readers(s);
        }
        if bound().any(|b| b.in_glsl == format!("{}Words", s.name)) {
            text += &words(s);
        }
    }
    text
}

/// Number of 32-bit words in a GLSL type.
fn word_count(ty: &str) -> usize {
    ty.chars().last().and_then(|c| c.to_digit(10)).unwrap_or(1) as usize
}

fn is_float(ty: &str) -> bool {
    ty == "float" || ty.starts_with("vec")
}

/// Number of words in one texel of a buffer of these structs, as `texel_bytes` in `src/gpu/buffer.rs` chooses it.
fn texel_words(s: &Struct) -> usize {
    if s.size.is_multiple_of(16) {
        4
    } else if s.size.is_multiple_of(8) {
        2
    } else {
        1
    }
}

/// The texels of the struct that hold a field.
fn texels_of(s: &Struct, field: &Field) -> Range<usize> {
    let (first, wide) = (field.offset / 4, texel_words(s));
    first / wide..(first + word_count(field.ty)).div_ceil(wide)
}

/// GLSL expression for a field's value, where `texel(i)` is the i-th texel of the struct.
fn value(s: &Struct, field: &Field, texel: impl Fn(usize) -> String) -> String {
    let (wide, first, count) = (texel_words(s), field.offset / 4, word_count(field.ty));
    let part = |i: usize| {
        let range = first.max(i * wide)..(first + count).min((i + 1) * wide);
        let swizzle: String = range.map(|word| ["x", "y", "z", "w"][word % wide]).collect();
        format!("{}.{swizzle}", texel(i))
    };
    let parts: Vec<_> = texels_of(s, field).map(part).collect();
    let words = match &parts[..] {
        [part] => part.clone(),
        parts => format!("uvec{count}({})", parts.join(", ")),
    };
    if is_float(field.ty) { format!("uintBitsToFloat({words})") } else { words }
}

/// Generates `Type_field(buffer, index)`, which fetches only the texels of the field, and `Type_load(buffer, index)`, which
/// fetches every texel once.
fn readers(s: &Struct) -> String {
    let (name, texels) = (s.name, s.size / 4 / texel_words(s));
    let fetch = |i: usize| match i {
        0 => format!("texelFetch(source, int({texels}u * index))"),
        i => format!("texelFetch(source, int({texels}u * index) + {i})"),
    };
    let (of_texel, swizzle) = match texel_words(s) {
        1 => ("uint", "x"),
        2 => ("uvec2", "xy"),
        _ => ("uvec4", "xyzw"),
    };
    let (mut readers, mut fetches, mut fields) = (String::new(), String::new(), String::new());
    for i in 0..texels {
        fetches += &format!("    {of_texel} t{i} = {}.{swizzle};\n", fetch(i));
    }
    for field in s.fields {
        let Field { name: of, ty, .. } = field;
        let read = value(s, field, fetch);
        readers += &format!("{ty} {name}_{of}(usamplerBuffer source, uint index) {{ return {read}; }}\n");
        fields += &format!("    s.{of} = {};\n", value(s, field, |i| format!("t{i}")));
    }
    format!(
        "{readers}{name} {name}_load(usamplerBuffer source, uint index) {{\n{fetches}    {name} s;\n{fields}    return s;\n}}\n"
    )
}

/// Generates `Type_zero()`, which returns a struct of zeros.
fn zero(s: &Struct) -> String {
    let fields: Vec<_> = s.fields.iter().map(|f| format!("{}(0)", f.ty)).collect();
    format!("{} {0}_zero() {{ return {0}({}); }}\n", s.name, fields.join(", "))
}

/// Generates `TypeWords`, a form of the struct that takes the fewest stores, and `Type_words(value)`, which converts to it.
/// lavapipe stores lane by lane and member by member: stores of 64 bits take half the time, and a store of four words is
/// fewer instructions than two of two.
fn words(s: &Struct) -> String {
    let of_field = |Field { name, ty, .. }: &Field| -> Vec<String> {
        let bits = |value: String| if is_float(ty) { format!("floatBitsToUint({value})") } else { value };
        match word_count(ty) {
            1 => vec![bits(format!("s.{name}"))],
            n => (0..n).map(|i| bits(format!("s.{name}[{i}]"))).collect(),
        }
    };
    let all: Vec<String> = s.fields.iter().flat_map(of_field).collect();
    let (mut members, mut values, mut rest) = (String::new(), Vec::new(), &all[..]);
    while !rest.is_empty() {
        let (ty, count) = match rest.len() {
            8.. => ("u64vec4", 8),
            4.. => ("u64vec2", 4),
            2.. => ("uint64_t", 2),
            _ => ("uint", 1),
        };
        let (now, later) = rest.split_at(count);
        let pair = |pair: &[String]| match pair {
            [low, high] => format!("packUint2x32(uvec2({low}, {high}))"),
            single => single.concat(),
        };
        members += &format!("    {ty} words{};\n", values.len());
        values.push(format!("{ty}({})", now.chunks(2).map(pair).collect::<Vec<_>>().join(", ")));
        rest = later;
    }
    let (name, values) = (s.name, values.join(", "));
    format!(
        "struct {name}Words {{\n{members}}};\n{name}Words {name}_words({name} s) {{ return {name}Words({values}); }}\n"
    )
}
