# Bash completion for `simulate` and `rosrun variator_sim simulate`; setup.bash sources it.
# Options, the files they take and the groups of columns are read from the tool's own --help.
case $- in
  *i*) ;;
  *) return 0 ;;
esac

_variator_sim_simulate="${CATKIN_ENV_HOOK_WORKSPACE:-}/lib/variator_sim/simulate"

# What stands behind an option in --help: FILE.csv, GROUPS; nothing of one without a value.
_variator_sim_placeholder() { # HELP OPTION
  sed -nE "s/^  $2(\[[^]]*\])? ([A-Z][^ ]*)( .*)?\$/\2/p" <<<"$1" | head -n 1
}

# Folders, and files whose names end as the placeholder's do: of FILE.csv|.bag .csv and .bag.
_variator_sim_files() { # PLACEHOLDER WORD
  local -a endings
  local name ending
  mapfile -t endings < <(grep -oE '\.[a-z]+' <<<"$1")
  compopt -o filenames 2>/dev/null
  mapfile -t COMPREPLY < <(
    if [[ ${#endings[@]} == 0 || $1 == DIRECTORY ]]; then
      compgen -f -- "$2"
    else
      compgen -d -- "$2"
      while IFS= read -r name; do
        [[ -d $name ]] && continue
        for ending in "${endings[@]}"; do
          if [[ $name == *"$ending" ]]; then printf '%s\n' "$name"; fi
        done
      done < <(compgen -f -- "$2")
    fi
  )
}

# Groups with commas between: the last one is completed.
_variator_sim_groups() { # HELP WORD
  local before=""
  [[ $2 == *,* ]] && before=${2%,*},
  mapfile -t COMPREPLY < <(
    compgen -P "$before" -W "$(sed -n '/^  --columns/,/^  --energy/p' <<<"$1" |
      grep -oE '[a-z]+ \(' | tr -d ' (' | tr '\n' ' ')" -- "${2##*,}"
  )
  compopt -o nospace 2>/dev/null
}

# Called as bash calls a completion: with the command, the word at the cursor and the one before.
_variator_sim_complete_simulate() {
  local program=$_variator_sim_simulate word=$2 previous=$3 help placeholder
  [[ -x $program ]] || program=$1
  COMPREPLY=()
  help=$("$program" --help 2>/dev/null) || return 0
  if [[ $previous == --columns ]]; then
    _variator_sim_groups "$help" "$word"
    return 0
  fi
  placeholder=""
  [[ $previous == --* ]] && placeholder=$(_variator_sim_placeholder "$help" "$previous")
  case $placeholder in
    "") ;;
    FILE* | DIRECTORY) _variator_sim_files "$placeholder" "$word"; return 0 ;;
    *\|STATE)
      _variator_sim_files "" "$word"
      mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -W "rest" -- "$word")
      return 0
      ;;
    *) return 0 ;; # a number, a path of the scene: nothing to offer
  esac
  if [[ $word == -* ]]; then
    mapfile -t COMPREPLY < <(
      compgen -W "$(grep -oE '^  --[a-z-]+' <<<"$help" | tr '\n' ' ')" -- "$word")
  else
    _variator_sim_files "SCENE.yaml" "$word"
  fi
}

# rosrun [--prefix COMMAND] [--debug] variator_sim simulate ...: the above; else what rosbash offers.
_variator_sim_complete_rosrun() {
  local first=1
  while [[ ${COMP_WORDS[first]:-} == -* ]]; do
    case ${COMP_WORDS[first]} in
      -p | --prefix) first=$((first + 2)) ;;
      *) first=$((first + 1)) ;;
    esac
  done
  if [[ ${COMP_WORDS[first]:-} == variator_sim && ${COMP_WORDS[first + 1]:-} == simulate ]] &&
    ((COMP_CWORD > first + 1)); then
    _variator_sim_complete_simulate simulate "$2" "$3"
  elif declare -F _roscomplete_exe >/dev/null; then
    _roscomplete_exe "$@"
  fi
}

# Now, and not when the first of its commands is completed: that would put its own in our place.
if ! declare -F _roscomplete_exe >/dev/null && [[ -f /usr/share/bash-completion/completions/rosbash ]]; then
  # shellcheck source=/dev/null
  . /usr/share/bash-completion/completions/rosbash
fi
complete -F _variator_sim_complete_simulate simulate
complete -F _variator_sim_complete_rosrun rosrun
