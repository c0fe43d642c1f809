//! Parses the interface of a kernel from its GLSL sources: buffers, push constants, specialisation constants and numbers.
use anyhow::{Context, Result, bail, ensure};
use std::collections::BTreeSet;
use std::path::Path;

/// A source file of a kernel: its name for messages, and its text.
pub type Source = (String, String);

/// The file whose constants are generated from Rust.
pub const EFFECTS: &str = "glsl/effects.glsl";

/// [`Binding::kind`] of an acceleration structure, which is no buffer: only the form of a kernel that traces by ray queries binds it.
pub const STRUCTURE: &str = "Structure";

/// A buffer that the kernel binds, or an acceleration structure.
#[derive(Clone, Default)]
pub struct Binding {
    /// Basename of the shared file that declares it; `None` for the kernel itself.
    pub group: Option<String>,
    pub number: u32,
    pub field: String,
    /// Rust name of the element type.
    pub element: String,
    /// GLSL name of the element type; empty for texels.
    pub in_glsl: String,
    /// Name of the variant of `gpu::SlotKind`, or [`STRUCTURE`].
    pub kind: &'static str,
    /// Name of the variant of `gpu::Access`.
    pub access: &'static str,
}

/// A constant whose value is set when the kernel is compiled.
#[derive(Clone)]
pub struct Constant {
    /// The shared file that declares it, as in [`Binding::group`].
    pub group: Option<String>,
    pub id: u32,
    /// Its name in the GLSL, in capitals.
    pub name: String,
    /// Rust name of the type.
    pub ty: &'static str,
    /// The default value: a literal, or the name of a number.
    pub default: String,
    pub comment: String,
}

/// A named number, such as `const uint ROWS = 4u;`.
#[derive(Clone)]
pub struct Number {
    /// The shared file that declares it, as in [`Binding::group`].
    pub group: Option<String>,
    pub name: String,
    /// Rust name of the type.
    pub ty: &'static str,
    /// The value as a Rust literal.
    pub value: String,
    pub comment: String,
}

/// Number of threads in a workgroup along x.
#[derive(Clone, Copy)]
pub enum LocalSizeX {
    Fixed(u32),
    /// The value of the specialisation constant with this id.
    Constant(u32),
}

pub struct Interface {
    pub push: String,
    pub bindings: Vec<Binding>,
    pub constants: Vec<Constant>,
    pub numbers: Vec<Number>,
    pub local_size_x: LocalSizeX,
    pub local_size_y: u32,
    /// Whether the kernel is specialised for the effects of a scene.
    pub effects: bool,
}

impl Interface {
    /// Parses the sources of a kernel. The first is the kernel itself.
    pub fn of(sources: &[Source]) -> Result<Self> {
        let (mut push, mut size) = (None, None);
        let (mut bindings, mut constants, mut numbers) = (Vec::<Binding>::new(), Vec::<Constant>::new(), Vec::new());
        let kernel = &sources[0].0;
        for (file, text) in sources.iter().filter(|(file, _)| file != EFFECTS) {
            let group = (file != kernel).then(|| basename(file));
            for (index, line) in text.lines().enumerate() {
                let place = || format!("{file}:{}: {}", index + 1, line.trim());
                if line.starts_with("const ") {
                    numbers.extend(parse_numbers(line, &group));
                } else if !line.trim_start().starts_with("layout(") {
                    continue;
                } else if line.contains("push_constant") {
                    ensure!(push.is_none(), "{}\na second push constant block", place());
                    push = Some(parse_push(line).with_context(place)?);
                } else if line.contains("constant_id") {
                    constants.push(Constant { group: group.clone(), ..parse_constant(line).with_context(place)? });
                } else if line.contains("local_size") {
                    size = Some(parse_local_size(line).with_context(place)?);
                } else if line.contains("binding") {
                    let new = Binding { group: group.clone(), ..parse_binding(line).with_context(place)? };
                    let taken = bindings.iter().any(|old| old.number == new.number || old.field == new.field);
                    ensure!(!taken, "{}\nits binding or its name is taken", place());
                    bindings.push(new);
                }
            }
        }
        ensure!(!bindings.is_empty(), "{kernel}: a kernel needs at least one buffer");
        let push = push.with_context(|| {
            format!("{kernel}: every kernel has `layout(scalar, push_constant) uniform Push {{ SomePush push; }};`")
        })?;
        let (local_size_x, local_size_y) =
            size.with_context(|| format!("{kernel}: no `layout(local_size_x = 64) in;`"))?;
        let effects = sources.iter().any(|(file, _)| file == EFFECTS);
        let interface = Self { push, bindings, constants, numbers, local_size_x, local_size_y, effects };
        interface.check_ids(kernel)?;
        Ok(interface)
    }

    /// Basenames of the shared files with bindings.
    pub fn bound_groups(&self) -> BTreeSet<String> {
        self.bindings.iter().filter_map(|b| b.group.clone()).collect()
    }

    /// Basenames of the shared files with specialisation constants.
    pub fn constant_groups(&self) -> BTreeSet<String> {
        self.constants.iter().filter_map(|c| c.group.clone()).collect()
    }

    /// Basenames of the shared files with bindings, constants or numbers.
    pub fn groups(&self) -> BTreeSet<String> {
        let numbers = self.numbers.iter().filter_map(|n| n.group.clone());
        self.bound_groups().into_iter().chain(self.constant_groups()).chain(numbers).collect()
    }

    pub fn bindings_of(&self, group: Option<&str>) -> Vec<Binding> {
        self.bindings.iter().filter(|b| b.group.as_deref() == group).cloned().collect()
    }

    pub fn constants_of(&self, group: Option<&str>) -> Vec<Constant> {
        self.constants.iter().filter(|c| c.group.as_deref() == group).cloned().collect()
    }

    pub fn numbers_of(&self, group: Option<&str>) -> Vec<Number> {
        self.numbers.iter().filter(|n| n.group.as_deref() == group).cloned().collect()
    }

    /// The constant that holds the size of the kernel's workgroup, if there is one.
    pub fn workgroup(&self) -> Option<&Constant> {
        self.constants.iter().find(|c| c.name == "WORKGROUP")
    }

    /// Checks that ids are unique, because two constants with one id would silently share a value. Effects have those below
    /// 100.
    fn check_ids(&self, kernel: &str) -> Result<()> {
        let mut taken = BTreeSet::new();
        if let LocalSizeX::Constant(id) = self.local_size_x {
            taken.insert(id);
        }
        for Constant { id, name, .. } in &self.constants {
            ensure!(*id >= 100, "{kernel}: constant_id {id} of {name} is an effect's: choose 100 or more");
            ensure!(taken.insert(*id), "{kernel}: constant_id {id} of {name} is taken");
        }
        Ok(())
    }
}

fn basename(file: &str) -> String {
    Path::new(file).file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the type and the name of the member between braces.
fn member(line: &str) -> Option<(&str, &str)> {
    let (_, rest) = line.split_once('{')?;
    rest.split_once(';')?.0.trim().split_once(' ')
}

fn parse_push(line: &str) -> Result<String> {
    match member(line) {
        Some((ty, "push")) => Ok(ty.to_owned()),
        _ => bail!("expected `layout(scalar, push_constant) uniform Push {{ SomePush push; }};`"),
    }
}

/// Splits a line into its code and its comment.
fn split_comment(line: &str) -> (&str, String) {
    match line.split_once("//") {
        Some((code, comment)) => (code.trim(), comment.trim().to_owned()),
        None => (line.trim(), String::new()),
    }
}

fn rust_type(glsl: &str) -> Option<&'static str> {
    match glsl {
        "uint" => Some("u32"),
        "int" => Some("i32"),
        "float" => Some("f32"),
        "bool" => Some("bool"),
        _ => None,
    }
}

/// Converts a literal of GLSL to Rust; they differ only in the suffix `u`.
fn rust_value(glsl: &str) -> String {
    glsl.trim().trim_end_matches('u').to_owned()
}

fn parse_constant(line: &str) -> Result<Constant> {
    let expected = "expected `layout(constant_id = 110) const bool NAME = true; // what it does`";
    let (code, comment) = split_comment(line);
    let parse = || {
        let (id, rest) = code.strip_prefix("layout(constant_id = ")?.split_once(')')?;
        let (ty, rest) = rest.trim().strip_prefix("const ")?.split_once(' ')?;
        let (name, default) = rest.strip_suffix(';')?.split_once(" = ")?;
        let (id, ty) = (id.parse().ok()?, rust_type(ty)?);
        Some(Constant { group: None, id, name: name.to_owned(), ty, default: rust_value(default), comment })
    };
    parse().context(expected)
}

/// Returns the numbers that are given by literals. Those computed from others are not exported to Rust.
fn parse_numbers(line: &str, group: &Option<String>) -> Vec<Number> {
    let (code, comment) = split_comment(line);
    let declared = code.strip_prefix("const ").and_then(|rest| rest.strip_suffix(';')?.split_once(' '));
    let Some((Some(ty), list)) = declared.map(|(ty, list)| (rust_type(ty), list)) else { return Vec::new() };
    let number = |item: &str| {
        let (name, value) = item.trim().split_once(" = ")?;
        let value = rust_value(value);
        let is_hexadecimal = value.strip_prefix("0x").is_some_and(|digits| u32::from_str_radix(digits, 16).is_ok());
        (is_hexadecimal || value.parse::<f64>().is_ok()).then_some(())?;
        Some(Number { group: group.clone(), name: name.to_owned(), ty, value, comment: comment.clone() })
    };
    list.split(',').filter_map(number).collect()
}

fn parse_local_size(line: &str) -> Result<(LocalSizeX, u32)> {
    let (code, _) = split_comment(line);
    let items = code.strip_prefix("layout(").and_then(|rest| rest.strip_suffix(") in;"));
    let items = items.context("expected `layout(local_size_x = 64) in;` or `layout(local_size_x_id = 100) in;`")?;
    let (mut x, mut y) = (None, 1);
    for item in items.split(',') {
        let (key, value) = item.split_once('=').context("expected `local_size_x = 64`")?;
        let value = value.trim().parse()?;
        match key.trim() {
            "local_size_x" => x = Some(LocalSizeX::Fixed(value)),
            "local_size_x_id" => x = Some(LocalSizeX::Constant(value)),
            "local_size_y" => y = value,
            other => bail!("{other} is not understood: use local_size_x, local_size_x_id, local_size_y"),
        }
    }
    Ok((x.context("local_size_x is missing")?, y))
}

fn parse_binding(line: &str) -> Result<Binding> {
    let parse = || {
        let (layout, declared) = line.trim().strip_prefix("layout(")?.split_once(')')?;
        let (memory, number) = layout.rsplit_once("binding = ")?;
        let binding = match memory {
            "scalar, " => storage(declared).or_else(|| uniform(declared)),
            "" => texels(declared).or_else(|| structure(declared)),
            _ => None,
        };
        Some(Binding { number: number.parse().ok()?, ..binding? })
    };
    parse().context(
        "expected `layout(scalar, binding = 0) readonly buffer Name { type field[]; };`, \
         `layout(binding = 0) uniform usamplerBuffer field; // of Type` or \
         `layout(scalar, binding = 0) uniform Name { Type field; };`",
    )
}

fn storage(declared: &str) -> Option<Binding> {
    let access = match declared.split_once(" buffer ")?.0.trim() {
        "readonly" => "Read",
        "writeonly" => "Write",
        "" | "coherent" => "ReadWrite",
        _ => return None,
    };
    let (in_glsl, field) = member(declared)?;
    let element = declared.split_once("// of ").map_or(in_glsl, |(_, of)| of.trim());
    Some(Binding {
        field: field.strip_suffix("[]")?.to_owned(),
        element: element.to_owned(),
        in_glsl: in_glsl.to_owned(),
        kind: "Storage",
        access,
        ..Binding::default()
    })
}

fn texels(declared: &str) -> Option<Binding> {
    let (kind, rest) = declared.trim().strip_prefix("uniform ")?.split_once(' ')?;
    let kind = match kind {
        "usamplerBuffer" => "UintTexels",
        "samplerBuffer" => "FloatTexels",
        _ => return None,
    };
    let (field, element) = rest.split_once("; // of ")?;
    let element = element.split_whitespace().next()?.to_owned();
    Some(Binding { field: field.trim().to_owned(), element, kind, access: "TexelRead", ..Binding::default() })
}

fn uniform(declared: &str) -> Option<Binding> {
    let (element, field) = member(declared.trim().strip_prefix("uniform ")?)?;
    Some(Binding {
        field: field.to_owned(),
        element: element.to_owned(),
        in_glsl: element.to_owned(),
        kind: "Uniform",
        access: "UniformRead",
        ..Binding::default()
    })
}

fn structure(declared: &str) -> Option<Binding> {
    let field = declared.trim().strip_prefix("uniform accelerationStructureEXT ")?.strip_suffix(';')?;
    Some(Binding { field: field.to_owned(), kind: STRUCTURE, ..Binding::default() })
}
