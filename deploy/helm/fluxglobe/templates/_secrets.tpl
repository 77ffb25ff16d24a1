{{/* Secrets as files, and the rights that our containers have: none. */}}

{{/* Which secrets a service reads: dict "root" $ "needs" (list NAME...). JSON: name of the folder -> what is in it. */}}
{{- define "fluxglobe.secrets" -}}
{{- $secrets := dict }}
{{- if has "postgis" .needs }}
{{- with .root.Values.postgis }}
{{- $_ := set $secrets "postgis" (dict "name" .secretName "password" true "caKey" .caKey) }}
{{- end }}
{{- end }}
{{- if has "kafka" .needs }}
{{- $hasUser := eq "yes" (include "fluxglobe.kafkaHasUser" .root) }}
{{- with .root.Values.kafka }}
{{- if or $hasUser .caKey }}
{{- $_ := set $secrets "kafka" (dict "name" .secretName "password" $hasUser "caKey" .caKey) }}
{{- end }}
{{- end }}
{{- end }}
{{- $secrets | toJson }}
{{- end }}

{{- define "fluxglobe.secretMounts" -}}
{{- range $folder, $_ := . }}
- {name: {{ $folder }}, mountPath: /run/secrets/{{ $folder }}, readOnly: true}
{{- end }}
{{- end }}

{{- define "fluxglobe.secretVolumes" -}}
{{- range $folder, $what := . }}
- name: {{ $folder }}
  secret:
    secretName: {{ $what.name }}
    defaultMode: 0440
    items:
      {{- if $what.password }}
      - {key: password, path: password}
      {{- end }}
      {{- with $what.caKey }}
      - {key: {{ . }}, path: ca.crt}
      {{- end }}
{{- end }}
{{- end }}

{{- define "fluxglobe.podSecurity" -}}
runAsNonRoot: true
runAsUser: 10001
runAsGroup: 10001
fsGroup: 10001
seccompProfile: {type: RuntimeDefault}
{{- end }}

{{- define "fluxglobe.containerSecurity" -}}
allowPrivilegeEscalation: false
readOnlyRootFilesystem: true
capabilities: {drop: [ALL]}
{{- end }}
