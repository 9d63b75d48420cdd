//! Folders, runs of the program and a scene, for its tests.
#![allow(dead_code, clippy::unwrap_used)]

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

/// A folder of its own for each test.
pub struct Folder(pub PathBuf);

impl Folder {
    pub fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("evolute-cli-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        fs::write(&path, text).unwrap();
        path
    }

    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(&self.0)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        self.run_with(arguments, "")
    }

    pub fn run_with(&self, arguments: &[&str], input: &str) -> Output {
        let mut child = Command::new(env!("CARGO_BIN_EXE_evolute"))
            .args(arguments)
            .current_dir(&self.0)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // A program that ends without reading closes the pipe: no fault of the test.
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        child.wait_with_output().unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

pub fn status(output: &Output) -> i32 {
    output.status.code().unwrap()
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

pub fn json(output: &Output) -> serde_json::Value {
    serde_json::from_str(stdout(output).lines().last().unwrap()).unwrap()
}

/// A lamp of 1 × 1 m, L = 100, over a floor, and a mirror standing beside.
pub const SCENE: &str = r#"<scene version="3.0.0">
    <default name="height" value="2"/>
    <sensor type="perspective">
        <float name="fov" value="40"/>
        <transform name="to_world">
            <lookat origin="0, -4, 1.5" target="0, 0, 0.3" up="0, 0, 1"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="24"/>
            <integer name="height" value="18"/>
        </film>
    </sensor>
    <shape type="rectangle" id="floor">
        <transform name="to_world"><scale value="2"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
    </shape>
    <shape type="rectangle" id="mirror">
        <transform name="to_world">
            <rotate y="1" angle="90"/>
            <translate x="-1.5" z="1"/>
        </transform>
        <bsdf type="conductor"><string name="material" value="none"/></bsdf>
    </shape>
    <shape type="rectangle" id="lamp">
        <transform name="to_world">
            <scale value="0.5"/>
            <rotate x="1" angle="180"/>
            <translate z="$height"/>
        </transform>
        <emitter type="area"><rgb name="radiance" value="100"/></emitter>
    </shape>
</scene>
"#;

pub const POINTS: &str = "x,y,z,nx,ny,nz,label\n0,0,0,0,0,1,middle\n0.5,0.25,0,0,0,2,\"right, back\"\n\
                      -1,0,0.5,1,0,0,facing the wall\n";
