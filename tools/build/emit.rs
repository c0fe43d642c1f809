//! Generates the Rust code for kernels and for the GLSL files that they share: typed bindings, specialisation constants and
//! numbers.
use crate::interface::{Binding, Constant, Interface, LocalSizeX, Number, STRUCTURE};
use anyhow::Result;
use std::fmt::Write as _;
use std::path::Path;

/// The declarations of a shared file.
pub struct Group {
    pub name: String,
    pub bindings: Vec<Binding>,
    pub constants: Vec<Constant>,
    pub numbers: Vec<Number>,
}

/// The code of a kernel, by the devices that it is for.
pub struct Binaries<'a> {
    /// Most devices.
    pub usual: &'a Path,
    /// Those that trace rays by ray queries; none for a kernel that traces no rays.
    pub ray_query: Option<&'a Path>,
}

/// Returns the fields of a `Bind` struct and the list of their buffers, both as Rust code.
fn members(bindings: &[Binding]) -> Result<(String, String)> {
    let (mut fields, mut list) = (String::new(), String::new());
    for Binding { number, field, element, kind, access, .. } in bindings {
        if *kind == STRUCTURE {
            writeln!(fields, "        /// Binding {number}, where rays are traced by ray queries.")?;
            writeln!(fields, "        pub {field}: Option<&'a Acceleration>,")?;
            continue;
        }
        writeln!(fields, "        /// Binding {number}, {kind}, {access}.")?;
        writeln!(fields, "        pub {field}: &'a Buffer<{element}>,")?;
        write!(list, "self.{field}.bound(), ")?;
    }
    Ok((fields, list))
}

/// Asserts that uniform blocks have at most 16 KiB, which every Vulkan device supports.
fn assert_sizes(bindings: &[Binding]) -> String {
    let uniform = bindings.iter().filter(|b| b.kind == "Uniform");
    uniform.map(|b| format!("    const _: () = assert!(size_of::<{}>() <= 16384);\n", b.element)).collect()
}

/// Turns a comment of the GLSL into documentation, or uses the name if there is none.
fn doc(name: &str, comment: &str) -> String {
    match comment {
        "" => format!("/// `{name}` of the GLSL."),
        comment => format!("/// `{name}`: {comment}"),
    }
}

fn numbers(list: &[Number]) -> Result<String> {
    let mut code = String::new();
    for Number { name, ty, value, comment, .. } in list {
        writeln!(code, "    {}", doc(name, comment))?;
        writeln!(code, "    pub const {name}: {ty} = {value};")?;
    }
    Ok(code)
}

/// The parts of a `Constants` struct.
#[derive(Default)]
struct Fields {
    declarations: String,
    defaults: String,
    /// Statements that add entries to `all`.
    entries: String,
    count: usize,
}

impl Fields {
    fn add(&mut self, name: &str, ty: &str, default: &str, documentation: &str) -> Result<()> {
        writeln!(self.declarations, "        {documentation}\n        pub {name}: {ty},")?;
        write!(self.defaults, "{name}: {default}, ")?;
        self.count += 1;
        Ok(())
    }

    fn add_own(&mut self, constant: &Constant) -> Result<()> {
        let Constant { id, name, ty, default, comment, .. } = constant;
        let field = name.to_lowercase();
        self.add(&field, ty, default, &doc(name, comment))?;
        let bits = if *ty == "f32" { ".to_bits()" } else { " as u32" };
        writeln!(self.entries, "            all.push(({id}, self.{field}{bits}));")?;
        Ok(())
    }

    fn code(&self, about: &str) -> String {
        let Self { declarations, defaults, entries, .. } = self;
        format!(
            r#"    /// {about}
    #[derive(Clone, Copy, Debug)]
    pub struct Constants {{
{declarations}    }}
    impl Default for Constants {{
        fn default() -> Self {{
            Self {{ {defaults}}}
        }}
    }}
    impl Constants {{
        /// (constant id, value) of all.
        #[allow(unused_mut)]
        pub fn entries(&self) -> Vec<(u32, u32)> {{
            let mut all = Vec::new();
{entries}            all
        }}
    }}
"#
        )
    }
}

/// The Rust module of a shared file.
pub fn group_module(group: &Group) -> Result<String> {
    let Group { name, .. } = group;
    let (fields, list) = members(&group.bindings)?;
    let mut code = format!("/// What `glsl/shared/{name}.glsl` declares.\n#[allow(clippy::all)]\npub mod {name} {{\n");
    code += "    #[allow(unused_imports)]\n    use crate::gpu::{Acceleration, Bound, Buffer};\n    #[allow(unused_imports)]\n    use crate::layout::*;\n";
    code += &numbers(&group.numbers)?;
    code += &assert_sizes(&group.bindings);
    if !group.bindings.is_empty() {
        code += &format!(
            r#"    /// One field of every kernel that includes the file.
    #[derive(Clone, Copy)]
    pub struct Bind<'a> {{
{fields}    }}
    impl Bind<'_> {{
        /// In the order of the fields.
        pub fn buffers(&self) -> Vec<Bound<'_>> {{
            vec![{list}]
        }}
    }}
"#
        );
    }
    if !group.constants.is_empty() {
        let mut fields = Fields::default();
        group.constants.iter().try_for_each(|c| fields.add_own(c))?;
        code += &fields.code("Specialisation constants: one field of every kernel that includes the file.");
    }
    Ok(code + "}\n")
}

/// The `Constants` struct of a kernel, which also gives its workgroup size.
fn constants(interface: &Interface, root: &str) -> Result<String> {
    let mut fields = Fields::default();
    if interface.effects {
        fields.add("effects", "Effects", "Effects::default()", "/// What the scene calls for.")?;
        fields.entries += "            all.extend(self.effects.entries());\n";
    }
    let groups = interface.constant_groups();
    for group in &groups {
        let ty = format!("{root}::shaders::shared::{group}::Constants");
        fields.add(group, &ty, "Default::default()", "/// Those of the file of this name.")?;
        writeln!(fields.entries, "            all.extend(self.{group}.entries());")?;
    }
    interface.constants_of(None).iter().try_for_each(|c| fields.add_own(c))?;
    let width = match (interface.local_size_x, interface.workgroup()) {
        (LocalSizeX::Fixed(n), _) => n.to_string(),
        (LocalSizeX::Constant(id), Some(constant)) => {
            let field = constant.group.iter().map(|group| format!("{group}.")).collect::<String>() + "workgroup";
            writeln!(fields.entries, "            all.push(({id}, self.{field}));")?;
            format!("self.{field}")
        }
        (LocalSizeX::Constant(id), None) => {
            fields.add("local_size_x", "u32", "1", "/// Threads of a workgroup.")?;
            writeln!(fields.entries, "            all.push(({id}, self.local_size_x));")?;
            "self.local_size_x".to_owned()
        }
    };
    let height = interface.local_size_y;
    let mut code = fields.code("Specialisation constants; their defaults are those of the GLSL.");
    write!(
        code,
        r#"    impl Specialise for Constants {{
        fn entries(&self) -> Vec<(u32, u32)> {{
            Self::entries(self)
        }}
        fn local_size(&self) -> [u32; 2] {{
            [{width}, {height}]
        }}
    }}
"#
    )?;
    if let (1, Some(group)) = (fields.count, groups.first()) {
        let ty = format!("{root}::shaders::shared::{group}::Constants");
        write!(
            code,
            r#"    impl From<{ty}> for Constants {{
        fn from({group}: {ty}) -> Self {{
            Self {{ {group} }}
        }}
    }}
"#
        )?;
    }
    Ok(code)
}

/// What the `Bindings` of a kernel say of ray queries.
fn ray_query(interface: &Interface, binaries: &Binaries) -> String {
    let structure = interface.bindings.iter().find(|b| b.kind == STRUCTURE);
    let (Some(Binding { group, number, field, .. }), Some(code)) = (structure, binaries.ray_query) else {
        return String::new();
    };
    let of = group.iter().map(|group| format!("{group}.")).collect::<String>();
    format!(
        r#"        const RAY_QUERY: Option<RayQueryCode> = Some(RayQueryCode {{ spirv: include_bytes!({code:?}), binding: {number} }});
        fn acceleration(&self) -> Option<&Acceleration> {{
            self.{of}{field}
        }}
"#
    )
}

/// The Rust module of one kernel.
pub fn module(name: &str, file: &Path, interface: &Interface, root: &str, binaries: &Binaries) -> Result<String> {
    let usual = binaries.usual;
    let push = &interface.push;
    let (mut fields, list) = members(&interface.bindings_of(None))?;
    let (mut slots, mut groups, mut order) = (String::new(), String::new(), interface.bindings_of(None));
    for group in interface.bound_groups() {
        writeln!(fields, "        /// What the file of this name binds.")?;
        writeln!(fields, "        pub {group}: {root}::shaders::shared::{group}::Bind<'a>,")?;
        writeln!(groups, "            all.extend(self.{group}.buffers());")?;
        order.extend(interface.bindings_of(Some(&group)));
    }
    for Binding { number, field, kind, access, .. } in order.iter().filter(|b| b.kind != STRUCTURE) {
        writeln!(
            slots,
            "            Slot {{ name: {field:?}, binding: {number}, kind: SlotKind::{kind}, access: Access::{access} }},"
        )?;
    }
    let numbers = numbers(&interface.numbers_of(None))?;
    let (constants, ray_query) = (constants(interface, root)?, ray_query(interface, binaries));
    let asserts = assert_sizes(&interface.bindings_of(None));
    let file = file.display();
    // Code that can name a kernel can run it with any numbers, so the crate's kernels are not visible outside.
    let visible = if root == "crate" { "#[allow(dead_code)]\npub(crate)" } else { "pub" };
    Ok(format!(
        r#"/// The kernel `{file}`.
#[allow(clippy::all)]
{visible} mod {name} {{
    #[allow(unused_imports)]
    use {root}::gpu::{{Acceleration, Access, Bindings, Bound, Buffer, RayQueryCode, Slot, SlotKind, Specialise}};
    #[allow(unused_imports)]
    use {root}::layout::*;
    /// Basename of the file, label of the pass.
    pub const NAME: &str = {name:?};
    /// The compiled code.
    pub static SPIRV: &[u8] = include_bytes!({usual:?});
    /// This kernel, specialised.
    pub type Kernel = {root}::gpu::Kernel<Bind<'static>>;
{numbers}{asserts}{constants}    /// What the kernel reads and writes.
    pub struct Bind<'a> {{
{fields}    }}
    // SAFETY: the code is what `glslc` made of the file, and the slots are what the file declares.
    #[allow(unsafe_code)]
    unsafe impl Bindings for Bind<'_> {{
        type Push = {push};
        type Constants = Constants;
        const NAME: &'static str = NAME;
        const SPIRV: &'static [u8] = SPIRV;
{ray_query}        const SLOTS: &'static [Slot] = &[
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
