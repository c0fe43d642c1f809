//! `glsl/*.comp` becomes SPIR-V and `$OUT_DIR/shaders.rs`, one module per kernel with a typed field per binding.
//! Bindings that a shared file declares are one struct, a module of that file's name, and one field of its kernels.
//! `glsl/test/*.comp` becomes `$OUT_DIR/test_shaders.rs` for the integration tests. Any error stops the build with
//! file and line. The compiler is `glslc`, as a program: Debian 12's libshaderc cannot be linked (undefined symbols).
//!
//! Bindings are read from lines of exactly these forms, in a kernel or in a file that it includes:
//! ```glsl
//! layout(scalar, binding = 3) readonly buffer Src { vec3 src[]; };  // or writeonly, or neither
//! layout(scalar, binding = 3) writeonly buffer Dst { u64vec2 dst[]; }; // of vec4, which it stores two floats at a time
//! layout(binding = 0) uniform usamplerBuffer nodes; // of BvhNode   // or samplerBuffer
//! layout(scalar, push_constant) uniform Push { PathPush push; };    // once per kernel
//! ```
use anyhow::{Context, Result, bail, ensure};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{env, fs};

#[allow(dead_code, unused_imports)]
#[path = "src/gpu/layout.rs"]
mod layout;

/// A file that a kernel is made of: name for messages, text.
type Source = (String, String);

#[derive(Clone)]
struct Binding {
    /// Basename of the shared file that declares it; none in the kernel itself.
    group: Option<String>,
    number: u32,
    field: String,
    /// Name of a type in layout.rs.
    element: String,
    /// Variant of `gpu::Slot`'s kind and access.
    kind: &'static str,
    access: &'static str,
}

struct Interface {
    push: String,
    bindings: Vec<Binding>,
}

impl Interface {
    /// Shared files with bindings.
    fn groups(&self) -> impl Iterator<Item = &str> {
        self.bindings.iter().filter_map(|b| b.group.as_deref()).collect::<BTreeSet<_>>().into_iter()
    }

    fn of(&self, group: Option<&str>) -> Vec<Binding> {
        self.bindings.iter().filter(|b| b.group.as_deref() == group).cloned().collect()
    }
}

fn main() {
    if let Err(error) = build() {
        eprintln!("{error:#}");
        std::process::exit(1);
    }
}

fn build() -> Result<()> {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=src/gpu/layout.rs");
    println!("cargo:rerun-if-changed=src/gpu/layout");
    println!("cargo:rerun-if-changed=glsl");
    let out = PathBuf::from(env::var("OUT_DIR")?);
    generate(Path::new("glsl"), "crate", &out.join("shaders.rs"))?;
    generate(Path::new("glsl/test"), "tallow", &out.join("test_shaders.rs"))
}

/// Compiles every kernel directly in `folder`; `root` is the path by which the generated code reaches the crate.
fn generate(folder: &Path, root: &str, target: &Path) -> Result<()> {
    let mut files: Vec<PathBuf> = fs::read_dir(folder)
        .with_context(|| format!("{}: cannot be listed", folder.display()))?
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<_>>()?;
    files.retain(|file| file.extension().is_some_and(|e| e == "comp"));
    files.sort();
    let (mut code, mut hash) = (String::new(), FNV_BASIS);
    let mut groups = BTreeMap::new();
    for file in &files {
        let name = file.file_stem().and_then(|s| s.to_str()).context("kernel names are ASCII")?;
        let (spirv, sources) = compile(file)?;
        hash = fnv(hash, &spirv);
        let binary = target.with_extension(format!("{name}.spv"));
        fs::write(&binary, &spirv)?;
        let interface = interface(&sources)?;
        code += &module(name, file, &interface, root, &binary)?;
        groups.extend(interface.groups().map(|group| (group.to_owned(), interface.of(Some(group)))));
    }
    if root == "crate" {
        for (name, bindings) in &groups {
            code += &group_module(name, bindings)?;
        }
    }
    writeln!(code, "/// FNV-1a over the SPIR-V of every kernel, part of the pipeline cache's name.")?;
    writeln!(code, "pub const HASH: u64 = {hash:#018x};")?;
    fs::write(target, code).with_context(|| format!("{}: cannot be written", target.display()))
}

/// SPIR-V, and the texts it was made from: the kernel first, then each file it includes.
fn compile(file: &Path) -> Result<(Vec<u8>, Vec<Source>)> {
    let label = file.display().to_string();
    let text = fs::read_to_string(file).with_context(|| label.clone())?;
    let mut sources = vec![(label.clone(), text.clone())];
    let whole = expand(&label, &text, &mut sources)?;
    let mut child = Command::new("glslc")
        .args(["-fshader-stage=compute", "--target-env=vulkan1.3", "-O", "-Werror", "-o", "-", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .context("glslc cannot be started: install the package glslc (on some distributions: shaderc)")?;
    // Nothing is printed before all is read, so this cannot block on a full pipe.
    child.stdin.take().context("glslc has no input")?.write_all(whole.as_bytes())?;
    let output = child.wait_with_output()?;
    let messages = String::from_utf8_lossy(&output.stderr).replace("<stdin>", &label);
    ensure!(output.status.success(), "glslc refused {label}:\n{messages}");
    Ok((output.stdout, sources))
}

/// Replaces `#include "name"` by the file, the first time that a kernel asks for it and by nothing after that, so that
/// files may include what they need. Line directives keep places in messages right.
fn expand(file: &str, text: &str, sources: &mut Vec<Source>) -> Result<String> {
    let mut whole = String::new();
    for (index, line) in text.lines().enumerate() {
        let Some(rest) = line.strip_prefix("#include") else {
            whole += &format!("{line}\n");
            continue;
        };
        let place = || format!("{file}:{}: {line}", index + 1);
        let name = rest.split('"').nth(1).with_context(|| format!("{}\nexpected #include \"name\"", place()))?;
        let path = format!("glsl/{name}");
        if sources.iter().all(|(seen, _)| *seen != path) {
            let content = read(name, &path).with_context(place)?;
            sources.push((path.clone(), content.clone()));
            whole += &format!("#line 1 \"{path}\"\n{}", expand(&path, &content, sources)?);
        }
        whole += &format!("#line {} \"{file}\"\n", index + 2);
    }
    Ok(whole)
}

fn read(name: &str, path: &str) -> Result<String> {
    Ok(match name {
        "layout.glsl" => {
            use layout::{allocate, filter};
            [layout::GLSL_CONSTANTS, layout::GLSL_STRUCTS, allocate::GLSL_STRUCTS, filter::GLSL_STRUCTS].concat()
        }
        "effects.glsl" => layout::effects::GLSL_EFFECTS.to_owned(),
        _ => fs::read_to_string(path).with_context(|| path.to_owned())?,
    })
}

fn interface(sources: &[Source]) -> Result<Interface> {
    let (mut push, mut bindings) = (None, Vec::<Binding>::new());
    for (file, text) in sources {
        for (index, line) in text.lines().enumerate().filter(|(_, line)| line.trim_start().starts_with("layout(")) {
            let place = || format!("{file}:{}: {}", index + 1, line.trim());
            if line.contains("push_constant") {
                ensure!(push.is_none(), "{}\na second push constant block", place());
                push = Some(parse_push(line).with_context(place)?);
            } else if line.contains("binding") {
                let group = (file != &sources[0].0).then(|| basename(file));
                let new = Binding { group, ..parse_binding(line).with_context(place)? };
                let taken = bindings.iter().any(|old| old.number == new.number || old.field == new.field);
                ensure!(!taken, "{}\nits binding or its name is taken", place());
                bindings.push(new);
            }
        }
    }
    let file = &sources[0].0;
    ensure!(!bindings.is_empty(), "{file}: a kernel needs at least one buffer");
    let push = push.with_context(|| {
        format!("{file}: every kernel has `layout(scalar, push_constant) uniform Push {{ SomePush push; }};`")
    })?;
    Ok(Interface { push, bindings })
}

fn basename(file: &str) -> String {
    Path::new(file).file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The words between braces, without the semicolon: a type and a name.
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

fn parse_binding(line: &str) -> Result<Binding> {
    parse_storage(line).or_else(|| parse_texels(line)).context(
        "expected `layout(scalar, binding = 0) readonly buffer Name { type field[]; };` or \
         `layout(binding = 0) uniform usamplerBuffer field; // of Type`",
    )
}

fn parse_storage(line: &str) -> Option<Binding> {
    let (number, rest) = line.trim().strip_prefix("layout(scalar, binding = ")?.split_once(')')?;
    let access = match rest.split_once(" buffer ")?.0.trim() {
        "readonly" => "Read",
        "writeonly" => "Write",
        "" => "ReadWrite",
        _ => return None,
    };
    let (element, field) = member(rest)?;
    let field = field.strip_suffix("[]")?.to_owned();
    let element = rest.split_once("// of ").map_or(element, |(_, of)| of.trim());
    Some(Binding {
        group: None,
        number: number.parse().ok()?,
        field,
        element: element.to_owned(),
        kind: "Storage",
        access,
    })
}

fn parse_texels(line: &str) -> Option<Binding> {
    let (number, rest) = line.trim().strip_prefix("layout(binding = ")?.split_once(')')?;
    let (kind, rest) = rest.trim().strip_prefix("uniform ")?.split_once(' ')?;
    let kind = match kind {
        "usamplerBuffer" => "UintTexels",
        "samplerBuffer" => "FloatTexels",
        _ => return None,
    };
    let (field, element) = rest.split_once("; // of ")?;
    let element = element.split_whitespace().next()?.to_owned();
    Some(Binding {
        group: None,
        number: number.parse().ok()?,
        field: field.trim().to_owned(),
        element,
        kind,
        access: "TexelRead",
    })
}

/// Fields of a struct, and the list of their buffers.
fn members(bindings: &[Binding]) -> Result<(String, String)> {
    let (mut fields, mut list) = (String::new(), String::new());
    for Binding { number, field, element, kind, access, .. } in bindings {
        writeln!(fields, "        /// Binding {number}, {kind}, {access}.")?;
        writeln!(fields, "        pub {field}: &'a Buffer<{element}>,")?;
        write!(list, "self.{field}.bound(), ")?;
    }
    Ok((fields, list))
}

/// The Rust module of a shared file with bindings.
fn group_module(name: &str, bindings: &[Binding]) -> Result<String> {
    let (fields, list) = members(bindings)?;
    Ok(format!(
        r#"/// What `glsl/shared/{name}.glsl` binds.
pub mod {name} {{
    use crate::gpu::{{Bound, Buffer, layout::*}};
    /// One field of every kernel that includes the file.
    #[derive(Clone, Copy)]
    pub struct Bind<'a> {{
{fields}    }}
    impl Bind<'_> {{
        /// In the order of the fields.
        pub fn buffers(&self) -> Vec<Bound<'_>> {{
            vec![{list}]
        }}
    }}
}}
"#
    ))
}

/// The Rust module of one kernel.
fn module(name: &str, file: &Path, interface: &Interface, root: &str, binary: &Path) -> Result<String> {
    let push = &interface.push;
    let (mut fields, list) = members(&interface.of(None))?;
    let (mut slots, mut groups, mut order) = (String::new(), String::new(), interface.of(None));
    for group in interface.groups() {
        writeln!(fields, "        /// What the file of this name binds.")?;
        writeln!(fields, "        pub {group}: {root}::shaders::{group}::Bind<'a>,")?;
        writeln!(groups, "            all.extend(self.{group}.buffers());")?;
        order.extend(interface.of(Some(group)));
    }
    for Binding { number, field, kind, access, .. } in order {
        writeln!(
            slots,
            "            Slot {{ name: {field:?}, binding: {number}, kind: SlotKind::{kind}, access: Access::{access} }},"
        )?;
    }
    let file = file.display();
    // Who can name a kernel of the crate can run it with any numbers, so that nobody outside can.
    let visible = if root == "crate" { "#[allow(dead_code)]\npub(crate)" } else { "pub" };
    Ok(format!(
        r#"/// The kernel `{file}`.
{visible} mod {name} {{
    #[allow(unused_imports)]
    use {root}::gpu::{{Access, Bindings, Bound, Buffer, Slot, SlotKind, layout::*}};
    /// Basename of the file, label of the pass.
    pub const NAME: &str = {name:?};
    /// The compiled code.
    pub static SPIRV: &[u8] = include_bytes!({binary:?});
    /// This kernel, specialised.
    pub type Kernel = {root}::gpu::Kernel<Bind<'static>>;
    /// What the kernel reads and writes.
    pub struct Bind<'a> {{
{fields}    }}
    // SAFETY: the code is what `glslc` made of the file, and the slots are what the file declares.
    #[allow(unsafe_code)]
    unsafe impl Bindings for Bind<'_> {{
        type Push = {push};
        const NAME: &'static str = NAME;
        const SPIRV: &'static [u8] = SPIRV;
        const SLOTS: &'static [Slot] = &[
{slots}        ];
        fn buffers(&self) -> Vec<Bound<'_>> {{
            #[allow(unused_mut)]
            let mut all = vec![{list}];
{groups}            all
        }}
    }}
    // 128 bytes is what every Vulkan device has.
    const _: () = assert!(size_of::<{push}>() <= 128 && size_of::<{push}>().is_multiple_of(4));
}}
"#
    ))
}

const FNV_BASIS: u64 = 0xcbf2_9ce4_8422_2325;

/// FNV-1a, 64 bits.
fn fnv(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3))
}
