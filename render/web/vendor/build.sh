#!/bin/sh
# Makes vendor/three.min.js and its licence again: needs npm, leaves nothing else behind.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp "$here/three-parts.js" "$work"
cd "$work"
npm install --no-save --no-audit --no-fund three@0.187.0 esbuild@0.28.2
npx esbuild three-parts.js --bundle --minify --format=esm --target=es2022 --legal-comments=inline --outfile="$here/three.min.js"
cp node_modules/three/LICENSE "$here/LICENSE-three.txt"
